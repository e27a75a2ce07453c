// One measurement, one JSON file: DIR/records/<configuration>.json, schema `amrtex-record/2`.
// Absent is null; 0 is a value. Tables are made from records and nothing else. Records of schema 1 are read, never written.
#pragma once

#include <filesystem>
#include <optional>
#include <string>
#include <string_view>
#include <vector>

#include "bench/numbers/image_error.hpp"
#include "structures/common/encoding.hpp"

namespace amrtex {

inline constexpr std::string_view kRecordSchema = "amrtex-record/2";
/// Its points were named by hashes that know neither spacing nor origin of a mesh: tables take them, a run never goes on from
/// them.
inline constexpr std::string_view kFirstSchema = "amrtex-record/1";

enum class Status { ok, unsupported, failed, over_budget };
std::string_view status_name(Status status);

/// A record with every fixed key in its order, all null but schema and status.
Json blank_record(Status status, std::string_view reason = "");

/// The value at a JSON pointer such as /frame/wall_ms/median; null where it, or something above it, is not there.
const Json& value_at(const Json& json, std::string_view pointer);

/// Parts of records. Times in milliseconds.
Json timing_json(std::span<const double> samples_ms);  ///< {"median", "mad", "ci95", "min", "n"}; null without samples
Json memory_json(const EncodedField& field, std::int64_t leaf_cells);
Json left_out_json(const EncodedField& field);
Json error_json(const ErrorMetrics& error, std::string_view reference_hash);

/// Throws Error naming the JSON pointer of the first thing that is missing or of the
/// wrong kind: a fixed key, an unknown status, a reason where there must be one, a sum
/// that is not the sum of its parts, a time without status `ok`, no `check` and no reason for that.
void validate_record(const Json& record);

/// 32 hex digits over the canonical text of a configuration: keys sorted, 1.0 the same
/// as 1. Throws Error for NaN and infinities, which JSON cannot tell apart from null.
std::string configuration_hash(const Json& configuration);

std::filesystem::path record_path(const std::filesystem::path& folder, std::string_view hash);
bool has_record(const std::filesystem::path& folder, std::string_view hash);
/// Whether the point's record is there and was drawn by this `implementation`. Throws Error naming the file when it is no valid
/// record.
bool has_record_of(const std::filesystem::path& folder, std::string_view hash, std::string_view implementation);
/// A record of schema 1 in the folder, where there is one. What is no JSON is passed over: `load_records` names it.
std::optional<std::filesystem::path> record_of_first_schema(const std::filesystem::path& folder);
/// Validates, then writes atomically: temporary name, fsync, rename. A record that
/// exists stays as it is unless `force`; returns whether this one was written.
bool write_record(const std::filesystem::path& folder, std::string_view hash, const Json& record, bool force);
/// Writes under a temporary name beside `target`, fsync, rename; what was there is replaced. Throws Error naming the file.
void write_atomically(const std::filesystem::path& target, std::string_view text);
/// One of schema 1 keeps its name of schema and gets null for each key that came later. Throws Error naming the file when it is
/// no valid record.
Json read_record(const std::filesystem::path& path);
/// All records of `folder`, by file name. Throws Error naming the broken file.
std::vector<Json> load_records(const std::filesystem::path& folder);

}  // namespace amrtex
