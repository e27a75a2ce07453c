#include "renderers/scene/triangle_reader.hpp"

#include <assimp/postprocess.h>
#include <assimp/scene.h>
#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <assimp/Importer.hpp>
#include <cctype>
#include <cstdint>
#include <fstream>
#include <sstream>

#include "structures/mesh/error.hpp"

namespace amrtex {
namespace {

namespace fs = std::filesystem;

constexpr std::array<std::string_view, 3> kExtensions{".obj", ".ply", ".stl"};

[[noreturn]] void refuse(const fs::path& path, std::string_view problem) {
  throw Error(fmt::format("{}: {}; accepted: OBJ, PLY or STL with triangles or polygons", path.string(), problem));
}

std::string extension_of(const fs::path& path) {
  std::string extension = path.extension().string();
  for (char& c : extension) c = static_cast<char>(std::tolower(static_cast<unsigned char>(c)));
  return extension;
}

/// The library repeats the last line of a text that ends too early: here the lines are counted, one an element.
void check_ply(const fs::path& path) {
  std::ifstream file(path);
  std::string line;
  bool text = false;
  std::uint64_t told = 0;
  while (std::getline(file, line) && !line.starts_with("end_header")) {
    std::istringstream words(line);
    std::string key, name;
    std::uint64_t count = 0;
    words >> key >> name;
    if (key == "format") text = name == "ascii";
    if (key == "element" && words >> count) told += count;
  }
  if (!text) return;
  std::uint64_t lines = 0;
  while (lines < told && std::getline(file, line))
    if (line.find_first_not_of(" \t\r") != std::string::npos) ++lines;
  if (lines < told)
    refuse(path, fmt::format("it ends after {} lines of vertices and faces; its header tells of {}", lines, told));
}

void add_triangles(const aiMesh& mesh, const fs::path& path, std::vector<Triangle>& triangles) {
  for (unsigned f = 0; f < mesh.mNumFaces; ++f) {
    const aiFace& face = mesh.mFaces[f];
    if (face.mNumIndices != 3) continue;  // a point or a line
    Triangle& triangle = triangles.emplace_back();
    for (unsigned i = 0; i < 3; ++i) {
      if (face.mIndices[i] >= mesh.mNumVertices)
        refuse(path, fmt::format("face {} names the vertex {} of {}", f, face.mIndices[i], mesh.mNumVertices));
      const aiVector3D& p = mesh.mVertices[face.mIndices[i]];
      triangle[i] = {static_cast<double>(p.x), static_cast<double>(p.y), static_cast<double>(p.z)};
    }
  }
}

}  // namespace

TriangleMesh read_triangles(const fs::path& path) {
  const std::string extension = extension_of(path);
  if (std::find(kExtensions.begin(), kExtensions.end(), extension) == kExtensions.end())
    refuse(path, fmt::format("the ending '{}' is not one of .obj, .ply, .stl", extension));
  std::error_code ignored;
  if (!fs::is_regular_file(path, ignored)) refuse(path, "no such file");
  if (extension == ".ply") check_ply(path);
  Assimp::Importer importer;
  // indices are validated before anything follows them
  const aiScene* scene = importer.ReadFile(path.string(), aiProcess_ValidateDataStructure | aiProcess_Triangulate);
  if (scene == nullptr) refuse(path, importer.GetErrorString());
  if ((scene->mFlags & AI_SCENE_FLAGS_INCOMPLETE) != 0) refuse(path, "it is incomplete");
  std::vector<Triangle> triangles;
  for (unsigned m = 0; m < scene->mNumMeshes; ++m) add_triangles(*scene->mMeshes[m], path, triangles);
  try {
    return TriangleMesh(std::move(triangles));
  } catch (const Error& e) {
    refuse(path, e.what());
  }
}

}  // namespace amrtex
