// What the parts that a structure does without would have cost to build.
#pragma once

#include "structures/common/encoding.hpp"

namespace amrtex {

/// Sets `seconds` of each entry of `field.left_out` that a scene can ask for (LeftOut::need): the median over `pairs` pairs of
/// builds, one with that part alone added and one as `request` has it, of their difference. Negative where leaving the part out
/// takes longer than building it, as pruning may; noise is as large as that of a build. Null stays where the part is refused or
/// passes a limit. `field` is what `request` built.
void time_left_out(const Encoding& encoding, const AmrHierarchy& hierarchy, const BuildRequest& request, EncodedField& field,
                   int pairs = 3);

}  // namespace amrtex
