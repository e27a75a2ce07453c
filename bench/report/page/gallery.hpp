// All experiments of a folder as a site: a page each, and an index with pictures.
#pragma once

#include <filesystem>
#include <optional>
#include <string>
#include <vector>

#include "bench/report/page/page_data.hpp"

namespace amrtex {

/// What a README says behind "**Question.**" and "**Conclusion.**", as plain text; empty where it does not.
struct Prose {
  std::string question, conclusion;
};
Prose read_prose(const std::filesystem::path& readme);
/// Of the experiment whose results `folder` holds: that of the nearest folder above it, within two, which has an experiment.json.
Prose prose_of_results(const std::filesystem::path& folder);

/// One folder of records with its tables.
ReportPart read_part(const std::filesystem::path& folder, std::vector<std::string>& warnings);

/// Folders below `experiment` that hold records, by name.
std::vector<std::filesystem::path> record_folders(const std::filesystem::path& experiment);

struct Gallery {
  std::size_t pages = 0;
  std::vector<std::string> without;  ///< experiments that have no records
  std::vector<std::string> warnings;
};

/// Writes `site`/index.html, scripts.js and a page for each folder in `experiments` that has records somewhere below it. Throws
/// Error where there is none at all.
Gallery write_gallery(const std::filesystem::path& experiments, const std::filesystem::path& site);

}  // namespace amrtex
