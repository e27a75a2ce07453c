// Facts of `octree` alone; what every encoding must do is in tests/.
#include "structures/octree/octree.hpp"

#include <gtest/gtest.h>

#include "structures/octree/octree_layout.h"
#include "tests/encoding_cases.hpp"
