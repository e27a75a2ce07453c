// What reading a data set takes: seconds and memory, as one line of JSON.
//   read_data DATA [FIELD]      the first field otherwise
#include <fmt/format.h>

#include <chrono>
#include <string>

#include "structures/mesh/amr_hierarchy.hpp"
#include "structures/mesh/process_memory.hpp"
#include "structures/readers/mesh_io.hpp"

namespace {

using Clock = std::chrono::steady_clock;

double seconds_since(Clock::time_point start) { return std::chrono::duration<double>(Clock::now() - start).count(); }

std::int64_t peak_bytes() {
  if (const auto bytes = amrtex::process_peak_bytes()) return *bytes;
  throw amrtex::Error("the system does not say how much memory a process holds");
}

std::int64_t field_bytes(const amrtex::MeshDescription& mesh) {
  std::int64_t bytes = 0;
  for (const auto& level : mesh.levels)
    for (const amrtex::Patch& patch : level)
      bytes += patch.box.cells() * static_cast<std::int64_t>(amrtex::bytes_of(patch.values.front().type()));
  return bytes;
}

}  // namespace

int main(int argc, char** argv) {
  if (argc < 2) {
    fmt::print(stderr, "read_data DATA [FIELD]\n");
    return 2;
  }
  try {
    const std::int64_t before = peak_bytes();
    const Clock::time_point start = Clock::now();
    amrtex::MeshDescription read = amrtex::read_mesh(argv[1], amrtex::FieldChoice::one(argc > 2 ? argv[2] : ""));
    const double read_seconds = seconds_since(start);
    const std::int64_t bytes = field_bytes(read);
    const std::int64_t read_peak = peak_bytes();
    const Clock::time_point built = Clock::now();
    const amrtex::AmrHierarchy mesh(std::move(read));
    fmt::print(
        R"({{"field_bytes": {}, "read_seconds": {:.6f}, "mesh_seconds": {:.6f}, "read_peak_bytes": {}, "peak_bytes": {}, "cells": {}}})"
        "\n",
        bytes, read_seconds, seconds_since(built), read_peak - before, peak_bytes() - before, mesh.stored_cells());
  } catch (const amrtex::Error& e) {
    fmt::print(stderr, "read_data: {}\n", e.what());
    return 1;
  }
  return 0;
}
