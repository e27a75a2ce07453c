// One measurement: schema `amrtex-record/2`. Absent is null; 0 is a value. Tables are made from records and nothing else. Records
// of schema 1 are read, never written. Where they stand: record_file.hpp.
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
/// Adds a scene's map of leaps to the memory of what it was made for, in role topology.
void add_leaps(Json& memory, std::int64_t bytes);
Json left_out_json(const EncodedField& field);
Json error_json(const ErrorMetrics& error, std::string_view reference_hash);

/// Throws Error naming the JSON pointer of the first thing that is missing or of the
/// wrong kind: a fixed key, an unknown status, a reason where there must be one, a sum
/// that is not the sum of its parts, a time without status `ok`, no `check` and no reason for that.
void validate_record(const Json& record);

/// 32 hex digits over the canonical text of a configuration: keys sorted, 1.0 the same
/// as 1. Throws Error for NaN and infinities, which JSON cannot tell apart from null.
std::string configuration_hash(const Json& configuration);

/// Older programs wrote a file a record: DIR/records/<configuration>.json, of schema 1 and early ones of schema 2. One of schema
/// 1 keeps its name of schema and gets null for each key that came later. Throws Error naming the file that is no valid record.
std::vector<Json> load_separate_records(const std::filesystem::path& folder);
/// One of these files, where there is any.
std::optional<std::filesystem::path> separate_record(const std::filesystem::path& folder);

}  // namespace amrtex
