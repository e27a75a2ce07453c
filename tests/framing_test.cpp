// Views that show all of a domain, and camera lines.
#include "renderers/scene/framing.hpp"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>

#include "structures/mesh/error.hpp"

namespace amrtex {
namespace {

/// The corners of a box in a picture, -1 to 1 from its left and its bottom.
std::vector<glm::dvec2> corners_in_picture(const Vec3d& lower, const Vec3d& upper, const View& view, int width, int height) {
  const CameraFrame camera = camera_frame(view, width, height);
  std::vector<glm::dvec2> places;
  for (int i = 0; i < 8; ++i) {
    const Vec3d corner((i & 1) != 0 ? upper.x : lower.x, (i & 2) != 0 ? upper.y : lower.y, (i & 4) != 0 ? upper.z : lower.z);
    const Vec3d way = corner - camera.eye;
    const double ahead = glm::dot(way, camera.forward);
    EXPECT_GT(ahead, 0);
    places.push_back({glm::dot(way, camera.right) / glm::dot(camera.right, camera.right) / ahead,
                      glm::dot(way, camera.up) / glm::dot(camera.up, camera.up) / ahead});
  }
  return places;
}

TEST(Framing, AllCornersLieInThePictureAndFillItWhateverTheShapeAndTheUnit) {
  struct Domain {
    Vec3d lower, upper;
  };
  const Domain domains[] = {{Vec3d(0), Vec3d(1)},
                            {{-3e24, 1e24, 0}, {3e24, 2e24, 1e24}},
                            {Vec3d(5e-9), {6e-9, 5.001e-9, 9e-9}},
                            {Vec3d(0), {1, 1, 1e-3}},
                            {Vec3d(-1), {99, 0, 0}},
                            {{1e6, 1e6, 1e6}, {1e6 + 1, 1e6 + 2, 1e6 + 3}}};
  const int sizes[][2] = {{512, 512}, {1920, 1080}, {200, 900}};
  for (const Domain& d : domains)
    for (const auto& [width, height] : sizes)
      for (const std::string_view name : framing_names()) {
        const View view = framing_view(d.lower, d.upper, name, static_cast<double>(width) / height);
        glm::dvec2 low(1), high(-1);
        for (const glm::dvec2& p : corners_in_picture(d.lower, d.upper, view, width, height)) {
          low = glm::min(low, p);
          high = glm::max(high, p);
        }
        // the margin is 6 % of half a picture, and the box reaches it on two sides that face each other
        const double edge = std::max({-low.x, -low.y, high.x, high.y});
        EXPECT_NEAR(edge, 0.94, 1e-6) << name;
        const bool across = std::abs(low.x + 0.94) < 1e-6 && std::abs(high.x - 0.94) < 1e-6;
        const bool upright = std::abs(low.y + 0.94) < 1e-6 && std::abs(high.y - 0.94) < 1e-6;
        EXPECT_TRUE(across || upright) << name;
      }
}

TEST(Framing, NamesSayWhereTheEyeStands) {
  const View view = framing_view(Vec3d(0), Vec3d(1), "-y", 1);
  EXPECT_LT(view.eye.y, 0);
  EXPECT_NEAR(view.eye.x, 0.5, 1e-12);
  EXPECT_NEAR(view.eye.z, 0.5, 1e-12);
  EXPECT_THROW(framing_view(Vec3d(0), Vec3d(1), "top", 1), UsageError);
}

TEST(Framing, ASlabIsSeenFromItsFlatSide) {
  const View view = framing_view(Vec3d(0), Vec3d(1, 1, 0.01), "corner", 1);
  EXPECT_GT(glm::normalize(view.eye - view.at).z, 0.8);
}

TEST(Framing, EdgesOfABoxAreTwelveAndMeetItsCorners) {
  const View view = framing_view(Vec3d(0), Vec3d(1), "corner", 1);
  const auto edges = box_edges(Vec3d(0), Vec3d(1), view, 100, 100);
  ASSERT_EQ(edges.size(), 12U);
  const auto places = corners_in_picture(Vec3d(0), Vec3d(1), view, 100, 100);
  EXPECT_NEAR(edges[0][0], (places[0].x + 1) * 50, 1e-9);
  EXPECT_NEAR(edges[0][1], (1 - places[0].y) * 50, 1e-9);
  View inside = view;
  inside.eye = Vec3d(0.5);
  EXPECT_LT(box_edges(Vec3d(0), Vec3d(1), inside, 100, 100).size(), 12U);
}

TEST(Framing, RaysMeetABoxOrPassIt) {
  EXPECT_TRUE(meets_box({{-1, 0.5, 0.5}, {1, 0, 0}}, Vec3d(0), Vec3d(1)));
  EXPECT_TRUE(meets_box({Vec3d(0.5), glm::normalize(Vec3d(1, 2, -3))}, Vec3d(0), Vec3d(1))) << "from inside";
  EXPECT_FALSE(meets_box({{-1, 0.5, 0.5}, {-1, 0, 0}}, Vec3d(0), Vec3d(1))) << "it lies behind";
  EXPECT_FALSE(meets_box({{-1, 1.5, 0.5}, {1, 0, 0}}, Vec3d(0), Vec3d(1)));
  EXPECT_FALSE(meets_box({{-1, 0, 0}, glm::normalize(Vec3d(1, 2, 0))}, Vec3d(0), Vec3d(1)));
}

TEST(CameraLine, IsReadAndWritten) {
  const View view = parse_camera_line("1 2 3  0.5 -4e-1 0  0 0 1 -fovy 40");
  EXPECT_EQ(view.eye, Vec3d(1, 2, 3));
  EXPECT_EQ(view.at, Vec3d(0.5, -0.4, 0));
  EXPECT_EQ(view.up, Vec3d(0, 0, 1));
  EXPECT_EQ(view.fov_y, 40);
  const View again = parse_camera_line(camera_line(view));
  EXPECT_EQ(again.at, view.at);
  EXPECT_EQ(again.fov_y, view.fov_y);
  EXPECT_EQ(parse_camera_line("--camera 0 0 3 0 0 0 0 1 0").fov_y, View{}.fov_y);
}

TEST(CameraLine, ThatIsNoneIsRefused) {
  for (const char* line : {"", "1 2 3", "1 2 3 4 5 6 7 8 nine", "0 0 0 0 0 0 0 1 0", "0 0 3 0 0 0 0 0 1",
                           "0 0 3 0 0 0 0 1 0 -fovy 190", "0 0 3 0 0 0 0 1 0 5", "0 0 nan 0 0 0 0 1 0"})
    EXPECT_THROW(parse_camera_line(line), UsageError) << line;
}

}  // namespace
}  // namespace amrtex
