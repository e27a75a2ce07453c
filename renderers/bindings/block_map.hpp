// A byte for each block of the domain, packed as shaders/block_maps.h lays it out.
#pragma once

#include <cstddef>
#include <cstdint>
#include <string>
#include <utility>
#include <vector>

#include "shaders/block_maps.h"
#include "structures/common/build_tools.hpp"

namespace amrtex {

/// The storage buffer `name`: `bytes` of blocks, x fastest; of several maps one after the other.
inline HostTexture block_map(std::string name, const std::vector<std::uint8_t>& bytes) {
  const std::size_t words = (bytes.size() + AMRTEX_BYTES_IN_WORD - 1) / AMRTEX_BYTES_IN_WORD;
  HostTexture buffer = make_buffer(std::move(name), TexelFormat::r32ui, static_cast<std::int64_t>(words));
  auto* packed = buffer.as<std::uint32_t>();
  for (std::size_t i = 0; i < bytes.size(); ++i)
    packed[i / AMRTEX_BYTES_IN_WORD] |= static_cast<std::uint32_t>(bytes[i]) << AMRTEX_BYTE_SHIFT(i);
  return buffer;
}

}  // namespace amrtex
