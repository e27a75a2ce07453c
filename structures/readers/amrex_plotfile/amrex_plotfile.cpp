#include "structures/readers/amrex_plotfile/amrex_plotfile.hpp"

#include <fmt/format.h>
#include <tbb/parallel_for.h>

#include <memory>
#include <new>

#include "structures/readers/amrex_plotfile/amrex_data.hpp"
#include "structures/readers/memory_check.hpp"
#include "structures/readers/reader_tools.hpp"
#include "structures/readers/slab.hpp"
#include "structures/readers/wanted_fields.hpp"

namespace amrtex {
namespace {

namespace fs = std::filesystem;

/// Of one field.
CheckedSize bytes_of(const FabSource& fab) {
  const Vec3l size = fab.valid.size();
  return CheckedSize(size.x) * size.y * size.z * fab.format.bytes;
}

CheckedSize bytes_of(const std::vector<LevelSources>& sources) {
  CheckedSize bytes;
  for (const LevelSources& level : sources)
    for (const FabSource& fab : level.fabs) bytes += bytes_of(fab);
  return bytes;
}

/// For the wanted fields of a level; none for a few small patches. Their bytes were checked before.
std::shared_ptr<CellMemory> memory_for(const LevelSources& level, std::size_t fields) {
  std::size_t bytes = 0;
  for (const FabSource& fab : level.fabs) bytes += fields * CellMemory::taken(static_cast<std::size_t>(bytes_of(fab).or_most()));
  return CellMemory::for_arrays(bytes);
}

void read_levels(const fs::path& path, const PlotHeader& header, const std::vector<LevelSources>& sources,
                 const std::vector<std::size_t>& wanted, MeshDescription& mesh) {
  try {
    mesh.levels.resize(sources.size());
    for (std::size_t level = 0; level < sources.size(); ++level) {
      const auto& fabs = sources[level].fabs;
      mesh.levels[level].resize(fabs.size());
      const std::shared_ptr<CellMemory> memory = memory_for(sources[level], wanted.size());
      const IndexBox& domain = header.domains[level];
      tbb::parallel_for(std::size_t{0}, fabs.size(), [&](std::size_t i) {
        Patch& patch = mesh.levels[level][i];
        const IndexBox& box = fabs[i].valid;
        // the box lies in a domain of at most 2^31 - 1 cells an axis, so that both corners fit
        patch.box = {Vec3i(box.lower - domain.lower), Vec3i(box.upper - domain.lower + std::int64_t{1})};
        patch.values = read_components(fabs[i], header.fields.size(), wanted, memory);
      });
    }
  } catch (const std::bad_alloc&) {
    throw Error(fmt::format("{}: not enough memory for the values of {} fields", path.string(), wanted.size()));
  }
}

}  // namespace

bool is_amrex_plotfile(const fs::path& path) {
  // a plotfile that lost its Header is still one, and its reader says what is missing
  std::error_code ignored;
  return fs::is_regular_file(path / "Header", ignored) || fs::is_directory(path / "Level_0", ignored);
}

MeshDescription read_amrex_plotfile(const fs::path& path, const FieldChoice& fields) {
  const PlotHeader header = scan_header(path);
  const std::vector<std::size_t> wanted = fields.among(path, header.fields);
  std::vector<LevelSources> sources;
  for (std::size_t level = 0; level < header.levels.size(); ++level) sources.push_back(locate_level(header, level));
  require_memory(path, bytes_of(sources), wanted.size(), 1);
  MeshDescription mesh;
  mesh.name = dataset_name(path);
  mesh.domain_lower = header.lower;
  mesh.domain_upper = header.upper;
  mesh.root_cells = Vec3i(header.domains.front().size());
  mesh.ratios = header.ratios;
  mesh.fields_there = header.fields;
  for (std::size_t component : wanted) mesh.fields.push_back(header.fields[component]);
  read_levels(path, header, sources, wanted, mesh);
  if (header.dimensions == 2) make_slab(mesh, path);
  return mesh;
}

}  // namespace amrtex
