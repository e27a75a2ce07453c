// `amrtex run --repeat N` measures a point in N processes, a record each: what stands for all of them.
#pragma once

#include <cstddef>
#include <span>
#include <vector>

#include "structures/mesh/json.hpp"

namespace amrtex {

/// Records of one point in one context.
using Repetitions = std::vector<const Json*>;

/// A folder may hold repetitions of an older program, which a later run did not replace: a point's are those of the program that
/// measured it last. Returns how many are left out.
std::size_t keep_last_program(Repetitions& point);

/// The first that is `ok`, else the first.
const Json& representative(const Repetitions& point);

/// A record a point and context, for tables, in the order of the points' first records. Of several repetitions it says what they
/// have in common; its times are medians of processes, `frame.wall_ms` with their spread. Where one failed, the point did: that
/// record stands for it, and its reason says how many of them did.
std::vector<Json> one_a_point(std::span<const Json> records);

}  // namespace amrtex
