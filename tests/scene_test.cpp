// Views, transfer functions, their JSON, and float pictures.
#include "renderers/scene/scene.hpp"

#include <fmt/format.h>
#include <gtest/gtest.h>
#include <unistd.h>

#include <cmath>
#include <filesystem>
#include <fstream>
#include <limits>

#include "renderers/scene/picture.hpp"
#include "structures/mesh/error.hpp"

namespace amrtex {
namespace {

namespace fs = std::filesystem;
constexpr double kNan = std::numeric_limits<double>::quiet_NaN();
constexpr double kInf = std::numeric_limits<double>::infinity();

void expect_near(const Vec3d& a, const Vec3d& b, double tolerance = 1e-14) {
  for (int k = 0; k < 3; ++k) EXPECT_NEAR(a[k], b[k], tolerance) << "axis " << k;
}

template <class Failure, class F>
std::string message_of(F&& action) {
  try {
    action();
  } catch (const Failure& failure) {
    return failure.what();
  }
  return "nothing was thrown";
}

void expect_mentions(const std::string& message, std::initializer_list<const char*> words) {
  for (const char* word : words) EXPECT_NE(message.find(word), std::string::npos) << message << " | " << word;
}

// ---- camera ----

TEST(Camera, PerspectiveRays) {
  const View view{{0, -4, 0}, {0, 0, 0}, {0, 0, 5}, 90, false, 1};
  const CameraFrame camera = camera_frame(view, 200, 100);
  expect_near(camera.forward, {0, 1, 0});
  expect_near(camera.right, {2, 0, 0});
  expect_near(camera.up, {0, 0, 1});
  const WorldRay corner = camera_ray(camera, 0, 0, 200, 100);  // top left
  expect_near(corner.origin, view.eye);
  expect_near(corner.direction, glm::normalize(Vec3d(-2 * 0.995, 1, 0.99)));
  const CameraFrame one = camera_frame(view, 1, 1);
  expect_near(camera_ray(one, 0, 0, 1, 1).direction, {0, 1, 0});
}

TEST(Camera, OrthographicRays) {
  const View view{{1, 2, 9}, {1, 2, 0}, {0, 1, 0.3}, 35, true, 4};
  const CameraFrame camera = camera_frame(view, 100, 50);
  const WorldRay ray = camera_ray(camera, 99, 49, 100, 50);  // bottom right
  expect_near(ray.direction, {0, 0, -1});
  expect_near(ray.origin, {1 + 4 * 0.99, 2 - 2 * 0.98, 9});
}

TEST(Camera, WorldsOfAnyScale) {
  for (const double scale : {1e-200, 1e-30, 1e24, 1e200}) {
    const CameraFrame camera = camera_frame({scale * Vec3d(1, 1, 1), Vec3d(0), {0, 0, 1}, 40, false, 1}, 3, 3);
    expect_near(camera_ray(camera, 1, 1, 3, 3).direction, -Vec3d(1, 1, 1) / std::sqrt(3.0));
  }
}

TEST(Camera, RefusesDegenerateViews) {
  const View good{{0, -4, 0}, {0, 0, 0}, {0, 0, 1}, 35, false, 1};
  const auto refused = [&](auto&& change, std::initializer_list<const char*> words) {
    View view = good;
    change(view);
    expect_mentions(message_of<Error>([&] { camera_frame(view, 8, 8); }), words);
  };
  refused([](View& v) { v.at = v.eye; }, {"eye", "at"});
  refused([](View& v) { v.eye.x = kNan; }, {"eye"});
  refused([](View& v) { v.up = {0, -2, 0}; }, {"up", "parallel"});
  refused([](View& v) { v.up = Vec3d(0); }, {"up"});
  refused([](View& v) { v.fov_y = 180; }, {"fov_y", "180"});
  refused([](View& v) { v.fov_y = kNan; }, {"fov_y"});
  refused([](View& v) { v.orthographic = true, v.height = 0; }, {"height"});
  EXPECT_THROW(camera_frame(good, 0, 8), Error);
}

// ---- transfer function ----

TransferFunction example() {
  TransferFunction tf;
  tf.extinction = {{1, 0}, {10, 4}, {100, 2}};
  tf.color = {{1, {1, 0, 0}}, {100, {0, 0, 1}}};
  return tf;
}

TEST(TransferFunctions, PiecewiseLinear) {
  const TransferFunction tf = example();
  for (const auto& [value, extinction] :
       {std::pair{0.0, 0.0}, {1, 0}, {5.5, 2}, {10, 4}, {55, 3}, {100, 2}, {1e9, 2}, {-kInf, 0}, {kInf, 2}})
    EXPECT_DOUBLE_EQ(tf.extinction_at(value), extinction) << value;
  expect_near(tf.color_at(50.5), {0.5, 0, 0.5});
  expect_near(tf.color_at(-3), {1, 0, 0});
  expect_near(tf.color_at(300), {0, 0, 1});
}

TEST(TransferFunctions, LogarithmicAxis) {
  TransferFunction tf = example();
  tf.logarithmic = true;
  EXPECT_DOUBLE_EQ(tf.extinction_at(std::sqrt(10.0)), 2);
  EXPECT_DOUBLE_EQ(tf.extinction_at(10 * std::sqrt(10.0)), 3);
  EXPECT_EQ(tf.extinction_at(0), 0);
  EXPECT_EQ(tf.extinction_at(-5), 0);
  expect_near(tf.color_at(10), {0.5, 0, 0.5});
  expect_near(tf.color_at(-1), {1, 0, 0});
}

TEST(TransferFunctions, LargestExtinctionOverARange) {
  const TransferFunction tf = example();
  EXPECT_DOUBLE_EQ(tf.max_extinction(0, 1), 0);
  EXPECT_DOUBLE_EQ(tf.max_extinction(0, 5.5), 2);
  EXPECT_DOUBLE_EQ(tf.max_extinction(0, 200), 4);
  EXPECT_DOUBLE_EQ(tf.max_extinction(55, 70), 3);
}

TEST(TransferFunctions, InfiniteExtinctionIsNoNan) {
  TransferFunction tf = example();
  tf.extinction = {{0, 0}, {1, kInf}, {2, 0}};
  validate(tf);
  EXPECT_EQ(tf.extinction_at(0), 0);
  EXPECT_EQ(tf.extinction_at(0.5), kInf);
  EXPECT_EQ(tf.extinction_at(1), kInf);
  EXPECT_EQ(tf.extinction_at(1.5), kInf);
  EXPECT_EQ(tf.extinction_at(2), 0);
}

TEST(TransferFunctions, Validation) {
  const auto refused = [](auto&& change, std::initializer_list<const char*> words) {
    TransferFunction tf = example();
    change(tf);
    expect_mentions(message_of<Error>([&] { validate(tf); }), words);
  };
  validate(example());
  refused([](TransferFunction& t) { t.extinction.clear(); }, {"extinction", "no point"});
  refused([](TransferFunction& t) { t.color.clear(); }, {"color", "no point"});
  refused([](TransferFunction& t) { t.extinction[1].value = 1; }, {"extinction", "point 1", "above"});
  refused([](TransferFunction& t) { t.extinction[1].extinction = -1; }, {"extinction", "point 1", "-1"});
  refused([](TransferFunction& t) { t.extinction[1].extinction = kNan; }, {"extinction", "point 1"});
  refused([](TransferFunction& t) { t.extinction[0].value = kNan; }, {"extinction", "point 0"});
  refused([](TransferFunction& t) { t.color[0].rgb.y = 1.5; }, {"color", "point 0", "1.5"});
  refused([](TransferFunction& t) { t.logarithmic = true, t.color[0].value = 0; }, {"color", "point 0", "logarithmic"});
}

// ---- JSON ----

TEST(SceneJson, ViewsRoundTrip) {
  for (const char* text : {R"({"eye":[1,2,3],"at":[0,0,0.5],"up":[0,1,0],"fov_y":35})",
                           R"({"eye":[1,2,3],"at":[0,0,0.5],"up":[0,1,0],"projection":"orthographic","height":2.5})"}) {
    const View view = parse_view(Json::parse(text));
    EXPECT_EQ(view.eye, Vec3d(1, 2, 3));
    EXPECT_EQ(to_json(parse_view(to_json(view))), to_json(view));
  }
  EXPECT_EQ(parse_view(Json::parse(R"({"eye":[1,2,3],"at":[0,0,0]})")).up, Vec3d(0, 0, 1));
}

TEST(SceneJson, ViewsErrorsNameTheKey) {
  const auto refused = [](const char* text, std::initializer_list<const char*> words) {
    expect_mentions(message_of<UsageError>([&] { parse_view(Json::parse(text)); }), words);
  };
  refused(R"({"eye":[1,2,3],"at":[0,0,0],"zoom":3})", {"zoom", "eye", "at", "up", "fov_y", "projection", "height"});
  refused(R"({"at":[0,0,0]})", {"eye"});
  refused(R"({"eye":[1,2],"at":[0,0,0]})", {"eye", "three numbers"});
  refused(R"({"eye":[1,2,"3"],"at":[0,0,0]})", {"eye", "a number is expected"});
  refused(R"({"eye":[1,2,3],"at":[0,0,0],"projection":"fisheye"})", {"projection", "fisheye", "perspective", "orthographic"});
  refused(R"({"eye":[1,2,3],"at":[0,0,0],"projection":"orthographic"})", {"height"});
  refused(R"({"eye":[1,2,3],"at":[0,0,0],"height":1})", {"height", "orthographic"});
  refused(R"({"eye":[1,2,3],"at":[0,0,0],"fov_y":"wide"})", {"fov_y", "number"});
  refused("[1,2,3]", {"eye"});
}

TEST(SceneJson, TransferFunctionsRoundTrip) {
  const Json json =
      Json::parse(R"({"extinction":[[1.0,0.0],[2.0,5.5]],"color":[[1.0,1.0,0.5,0.0]],"scale":"log","length_unit":"world"})");
  const TransferFunction tf = parse_transfer_function(json);
  EXPECT_TRUE(tf.logarithmic);
  EXPECT_EQ(tf.length_unit, TransferFunction::LengthUnit::world);
  EXPECT_EQ(tf.extinction[1].extinction, 5.5);
  EXPECT_EQ(tf.color[0].rgb, Vec3d(1, 0.5, 0));
  EXPECT_EQ(to_json(tf), json);
}

TEST(SceneJson, TransferFunctionErrorsNameTheKey) {
  const auto refused = [](const char* text, std::initializer_list<const char*> words) {
    expect_mentions(message_of<Error>([&] { parse_transfer_function(Json::parse(text)); }), words);
  };
  refused(R"({"extinction":[[1,0]],"color":[[1,1,1,1]],"opacity":[]})",
          {"opacity", "extinction", "color", "scale", "length_unit"});
  refused(R"({"extinction":[[1,0]]})", {"color"});
  refused(R"({"extinction":[[1,0,3]],"color":[[1,1,1,1]]})", {"extinction", "[value, extinction]"});
  refused(R"({"extinction":[[1,0]],"color":[[1,1,1]]})", {"color", "[value, r, g, b]"});
  refused(R"({"extinction":[[1,0]],"color":[[1,1,1,1]],"scale":"ln"})", {"scale", "ln", "linear", "log"});
  refused(R"({"extinction":[[1,0]],"color":[[1,1,1,1]],"length_unit":"cell"})", {"length_unit", "longest_edge", "world"});
  refused(R"({"extinction":[[1,0],[0,1]],"color":[[1,1,1,1]]})", {"extinction", "point 1"});
}

TEST(SceneJson, ModesAndSamplings) {
  for (const Mode mode : {Mode::dvr, Mode::projection, Mode::mip}) EXPECT_EQ(parse_mode(mode_name(mode)), mode);
  for (const Sampling s : {Sampling::lattice, Sampling::adaptive}) EXPECT_EQ(parse_sampling(sampling_name(s)), s);
  expect_mentions(message_of<UsageError>([] { parse_mode("xray"); }), {"xray", "dvr", "projection", "mip"});
  expect_mentions(message_of<UsageError>([] { parse_sampling("random"); }), {"random", "lattice", "adaptive"});
}

// ---- pictures ----

class PictureFile : public ::testing::Test {
 protected:
  PictureFile() : folder_(fs::temp_directory_path() / fmt::format("amrtex_picture_{}", ::getpid())) {
    fs::create_directories(folder_);
  }
  ~PictureFile() override { fs::remove_all(folder_); }
  fs::path folder_;
};

Picture gradient(int channels) {
  Picture picture(5, 3, channels);
  for (std::size_t i = 0; i < picture.values.size(); ++i) picture.values[i] = static_cast<double>(i) / 7.0;
  return picture;
}

TEST_F(PictureFile, NpyRoundTrip) {
  for (const bool as_double : {false, true})
    for (const int channels : {1, 4}) {
      const Picture picture = gradient(channels);
      write_npy(picture, folder_ / "a.npy", as_double);
      const Picture back = read_npy(folder_ / "a.npy");
      EXPECT_EQ(back.width, 5);
      EXPECT_EQ(back.height, 3);
      EXPECT_EQ(back.channels, channels);
      for (std::size_t i = 0; i < picture.values.size(); ++i)
        EXPECT_EQ(back.values[i], as_double ? picture.values[i] : static_cast<double>(static_cast<float>(picture.values[i])));
      EXPECT_EQ(picture_hash(back), picture_hash(picture));
    }
  EXPECT_EQ(std::distance(fs::directory_iterator(folder_), {}), 1) << "no temporary file is left";
}

TEST_F(PictureFile, NpyHeaderIsNumPys) {
  write_npy(gradient(4), folder_ / "a.npy", false);
  std::ifstream in(folder_ / "a.npy", std::ios::binary);
  const std::string bytes{std::istreambuf_iterator<char>(in), {}};
  EXPECT_EQ(bytes.substr(0, 8), std::string("\x93NUMPY\x01\x00", 8));
  expect_mentions(bytes, {"{'descr': '<f4', 'fortran_order': False, 'shape': (3, 5, 4), }"});
  EXPECT_EQ((bytes.size() - 3 * 5 * 4 * 4) % 64, 0U);
}

TEST_F(PictureFile, NpyErrorsNameThePath) {
  const fs::path path = folder_ / "broken.npy";
  const auto refused = [&](const std::string& bytes, std::initializer_list<const char*> words) {
    std::ofstream(path, std::ios::binary) << bytes;
    const std::string message = message_of<Error>([&] { read_npy(path); });
    expect_mentions(message, words);
    expect_mentions(message, {"broken.npy"});
  };
  const std::string magic("\x93NUMPY\x01\x00\x76\x00", 10);
  const auto header = [&](std::string text) {
    text.resize(0x76, ' ');
    return magic + text;
  };
  refused("", {"npy"});
  refused("PNG and so on", {"npy"});
  refused(magic, {"header"});
  refused(header("{'descr': '<i4', 'fortran_order': False, 'shape': (1, 1, 1), }"), {"<i4", "<f4"});
  refused(header("{'descr': '<f4', 'fortran_order': True, 'shape': (1, 1, 1), }"), {"Fortran"});
  refused(header("{'descr': '<f4', 'fortran_order': False, 'shape': (1, 1), }"), {"shape"});
  refused(header("{'descr': '<f4', 'fortran_order': False, 'shape': (99999, 99999, 4), }"), {"bytes"});
  refused(header("{'descr': '<f4', 'fortran_order': False, 'shape': (-1, 1, 1), }"), {"shape"});
  refused(header("nothing"), {"descr"});
  expect_mentions(message_of<Error>([&] { read_npy(folder_ / "none.npy"); }), {"none.npy"});
  expect_mentions(message_of<Error>([&] { write_npy(gradient(1), folder_ / "no" / "folder.npy", true); }), {"folder.npy"});
}

TEST_F(PictureFile, HashSeesTheFloats) {
  Picture picture = gradient(1);
  const std::string hash = picture_hash(picture);
  EXPECT_EQ(hash.size(), 32U);
  picture.values[3] += 1e-12;
  EXPECT_EQ(picture_hash(picture), hash) << "below float";
  picture.values[3] += 1e-6;
  EXPECT_NE(picture_hash(picture), hash);
}

TEST_F(PictureFile, PngOfLightAndValues) {
  PngOptions options;
  options.color_bar = true;
  options.logarithmic = true;
  options.title = "rho (g/cm^2)";
  Picture values = gradient(1);
  values.values[1] = kNan;
  for (const Picture& picture : {gradient(4), gradient(1), values}) {
    write_png(picture, folder_ / "a.png", options);
    std::ifstream in(folder_ / "a.png", std::ios::binary);
    const std::string bytes{std::istreambuf_iterator<char>(in), {}};
    EXPECT_EQ(bytes.substr(1, 3), "PNG");
    const int width = 256 * static_cast<unsigned char>(bytes[18]) + static_cast<unsigned char>(bytes[19]);
    EXPECT_TRUE(picture.channels == 4 ? width == 5 : width > 5) << "the colour bar stands beside";
  }
  EXPECT_THROW(write_png(gradient(3), folder_ / "a.png"), Error);
  expect_mentions(message_of<Error>([&] { write_png(gradient(4), folder_ / "no" / "a.png"); }), {"a.png"});
}

}  // namespace
}  // namespace amrtex
