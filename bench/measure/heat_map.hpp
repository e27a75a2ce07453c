// What drawing a pixel took, and how far off it is, as pictures of one channel.
#pragma once

#include <array>
#include <string>
#include <string_view>
#include <vector>

#include "renderers/consumers/consumer.hpp"
#include "renderers/scene/picture.hpp"

namespace amrtex {

/// Samples and regions that the shader counted along the pixel's ray; the finest level in which it took a sample; and the
/// picture's difference to its reference.
enum class Heat { samples, regions, level, error };
std::string_view heat_name(Heat heat);
const std::vector<std::string>& heat_names();
/// Throws a UsageError that names them.
Heat parse_heat(std::string_view name);

/// Of a heat that the shader counts. NaN where the ray passes the domain by, and of `level` where it takes no sample.
Picture counted_picture(Heat heat, const std::vector<PixelWork>& work, int width, int height);

/// picture - reference: of each pixel that of the channel where it is largest, with its sign.
Picture error_picture(const Picture& picture, const Picture& reference);
/// The same of differences by channel.
Picture largest_difference(const Picture& difference);

/// Of signed values: the same on both sides of 0, and not empty.
std::array<double, 2> around_zero(const Picture& picture);

}  // namespace amrtex
