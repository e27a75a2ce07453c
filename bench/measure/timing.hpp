// Frame times of a consumer.
#pragma once

#include <vector>

#include "renderers/consumers/consumer.hpp"

namespace amrtex {

/// Frame times through Google Benchmark with manual time: `warm_up` frames are dropped.
std::vector<FrameTime> time_frames(Consumer& consumer, int warm_up, int frames);

}  // namespace amrtex
