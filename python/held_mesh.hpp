// A mesh that Python holds: read, or made of arrays.
#pragma once

#include <map>
#include <memory>
#include <mutex>
#include <string>
#include <vector>

#include "structures/mesh/amr_hierarchy.hpp"

namespace amrtex {

class HeldMesh {
 public:
  /// `source`: its file or folder, for messages; empty where there is none.
  HeldMesh(AmrHierarchy mesh, std::string source)
      : mesh_(std::make_shared<const AmrHierarchy>(std::move(mesh))), source_(std::move(source)) {}

  const AmrHierarchy& mesh() const { return *mesh_; }
  const std::string& source() const { return source_; }
  /// Of these fields alone, the first of them being the drawn one; the mesh itself where they are its first ones. The copy that
  /// was made last is kept. Throws UsageError naming the fields there are.
  std::shared_ptr<const AmrHierarchy> with_fields(const std::vector<std::string>& names);

 private:
  std::shared_ptr<const AmrHierarchy> mesh_;
  std::string source_;
  std::mutex mutex_;
  std::vector<std::string> copied_;
  std::shared_ptr<const AmrHierarchy> copy_;
};

/// The domain and the patches as a caller's arrays have them.
struct ArrayMesh {
  MeshDescription frame;             ///< name, domain, ratios, fields; root_cells of 0: as far as the boxes of level 0 reach
  std::vector<std::int64_t> levels;  ///< of each patch
  std::vector<Patch> patches;        ///< their boxes and values
};
/// Throws Error naming the patch and what is accepted.
AmrHierarchy make_hierarchy(ArrayMesh arrays);

}  // namespace amrtex
