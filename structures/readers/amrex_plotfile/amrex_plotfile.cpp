#include "structures/readers/amrex_plotfile/amrex_plotfile.hpp"

#include <fmt/format.h>
#include <tbb/parallel_for.h>
#include <unistd.h>

#include <algorithm>
#include <new>

#include "structures/mesh/quoted.hpp"
#include "structures/readers/amrex_plotfile/amrex_data.hpp"
#include "structures/readers/reader_tools.hpp"

namespace amrtex {
namespace {

namespace fs = std::filesystem;

void read_patch(const FabSource& fab, const IndexBox& domain, std::size_t components, const std::vector<std::size_t>& wanted,
                Patch& patch) {
  // the box lies in a domain of at most 2^31 - 1 cells an axis, so that both corners fit
  patch.box = {Vec3i(fab.valid.lower - domain.lower), Vec3i(fab.valid.upper - domain.lower + std::int64_t{1})};
  patch.values = read_components(fab, components, wanted);
}

/// Sparse files make sizes that no memory holds: found out before anything is allocated.
void check_memory(const fs::path& path, const std::vector<LevelSources>& sources, std::size_t fields) {
  double bytes = 0;
  for (const LevelSources& level : sources)
    for (const FabSource& fab : level.fabs) {
      const Vec3d size(fab.valid.size());
      bytes += size.x * size.y * size.z * static_cast<double>(fields * sizeof(double));
    }
  const double memory = static_cast<double>(::sysconf(_SC_PHYS_PAGES)) * static_cast<double>(::sysconf(_SC_PAGESIZE));
  if (bytes > memory)
    throw BudgetError(fmt::format("{}: the values of {} fields take {:.3e} bytes, this machine has {:.3e}", path.string(), fields,
                                  bytes, memory));
}

void read_levels(const fs::path& path, const PlotHeader& header, const std::vector<LevelSources>& sources,
                 const std::vector<std::size_t>& wanted, MeshDescription& mesh) {
  try {
    mesh.levels.resize(sources.size());
    for (std::size_t level = 0; level < sources.size(); ++level) {
      const auto& fabs = sources[level].fabs;
      mesh.levels[level].resize(fabs.size());
      tbb::parallel_for(std::size_t{0}, fabs.size(), [&](std::size_t patch) {
        read_patch(fabs[patch], header.domains[level], header.fields.size(), wanted, mesh.levels[level][patch]);
      });
    }
  } catch (const std::bad_alloc&) {
    throw Error(fmt::format("{}: not enough memory for the values of {} fields", path.string(), wanted.size()));
  }
}

/// Components to read: those of the fields, or all.
std::vector<std::size_t> wanted_components(const fs::path& path, const PlotHeader& header,
                                           const std::vector<std::string>& fields) {
  std::vector<std::size_t> wanted;
  for (const std::string& field : fields.empty() ? header.fields : fields) {
    const auto found = std::find(header.fields.begin(), header.fields.end(), field);
    if (found == header.fields.end())
      throw UsageError(fmt::format("{}: no field {}; its fields are {}", path.string(), quote(field), listed(header.fields)));
    wanted.push_back(static_cast<std::size_t>(found - header.fields.begin()));
  }
  return wanted;
}

}  // namespace

bool is_amrex_plotfile(const fs::path& path) {
  // a plotfile that lost its Header is still one, and its reader says what is missing
  std::error_code ignored;
  return fs::is_regular_file(path / "Header", ignored) || fs::is_directory(path / "Level_0", ignored);
}

MeshDescription read_amrex_plotfile(const fs::path& path, const std::vector<std::string>& fields) {
  const PlotHeader header = scan_header(path);
  const std::vector<std::size_t> wanted = wanted_components(path, header, fields);
  std::vector<LevelSources> sources;
  for (std::size_t level = 0; level < header.levels.size(); ++level) sources.push_back(locate_level(header, level));
  check_memory(path, sources, wanted.size());
  MeshDescription mesh;
  mesh.name = dataset_name(path);
  mesh.domain_lower = header.lower;
  mesh.domain_upper = header.upper;
  mesh.root_cells = Vec3i(header.domains.front().size());
  mesh.ratios = header.ratios;
  for (std::size_t component : wanted) mesh.fields.push_back(header.fields[component]);
  read_levels(path, header, sources, wanted, mesh);
  return mesh;
}

}  // namespace amrtex
