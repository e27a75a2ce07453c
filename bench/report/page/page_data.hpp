// Everything that a report's page says, computed from records: the page's scripts only show it.
#pragma once

#include <filesystem>
#include <string>
#include <vector>

#include "bench/report/diagram.hpp"
#include "bench/report/plot.hpp"
#include "bench/report/table.hpp"

namespace amrtex {

/// The records of one folder.
struct ReportPart {
  std::filesystem::path folder;
  std::vector<Json> records;      ///< one a point (repetitions.hpp)
  std::vector<Table> tables;      ///< beside the table of all points: those beside a paper, of work-precision, scatter
  std::vector<Diagram> diagrams;  ///< those that only tables.json asks for: scatter
};

struct PageOptions {
  std::string title;
  std::string question, conclusion;  ///< in prose; empty: the page asks what its records answer
  std::vector<std::string> picked;   ///< points whose pictures are shown first, by the beginning of their configuration
  int most_pixels = 1 << 14;         ///< along a side of a picture
  bool live_plots = true;            ///< Vega-Lite; else pictures of the plots
};

/// At most so many pictures a page, and together so many bytes.
inline constexpr std::size_t kMostPictures = 40;
inline constexpr std::size_t kMostPictureBytes = 4 << 20;

struct PageData {
  Json json;  ///< (README.md beside this file)
  std::vector<Table> tables;
  std::vector<const Json*> pictured;  ///< records of the parts whose pictures it shows, what matters most first
  std::string cover;                  ///< the first of these pictures as a data URI; empty: none
  std::vector<std::string> warnings;
};

/// Parts without records are left out. Throws Error where there are no records at all.
PageData page_data(const std::vector<ReportPart>& parts, const PageOptions& options);

/// The plots of a folder, as files of their own, by the name of the file: <kind>_<scene>.
std::vector<Plot> report_plots(const std::vector<Json>& records);

}  // namespace amrtex
