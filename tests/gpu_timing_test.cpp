// Times of GPU timer queries: what is decided about them, and what real queries of this machine give.
#include "bench/measure/gpu_timing.hpp"

#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <unistd.h>

#include <filesystem>
#include <fstream>

#include "renderers/consumers/raycaster.hpp"
#include "tests/pictures.hpp"

namespace amrtex::test {
namespace {

namespace fs = std::filesystem;
using testing::ElementsAre;
using testing::HasSubstr;

TEST(DrawsPerQuery, MakeFiveMilliseconds) {
  EXPECT_EQ(draws_per_query(20), 1);
  EXPECT_EQ(draws_per_query(1), 1);
  EXPECT_EQ(draws_per_query(0.999), 6);  // 5 / 0.999, and the rest
  EXPECT_EQ(draws_per_query(0.5), 10);
  EXPECT_EQ(draws_per_query(0.01), 500);
  EXPECT_EQ(draws_per_query(0), 4096) << "a frame below the timer's resolution";
  EXPECT_EQ(draws_per_query(std::nan("")), 1);
  for (const double ms : {0.0013, 0.07, 0.3, 0.8}) EXPECT_GE(draws_per_query(ms) * ms, 5 - 1e-9) << ms;
}

TEST(Steady, IsWhatLiesWithinFivePercentOfItsMedian) {
  using Times = std::vector<double>;
  EXPECT_FALSE(is_steady(Times{1, 1, 1, 1})) << "too few to tell";
  EXPECT_TRUE(is_steady(Times{1, 1, 1, 1, 1}));
  EXPECT_TRUE(is_steady(Times{9, 7, 1, 1.04, 0.96, 1, 1})) << "the last five count";
  EXPECT_FALSE(is_steady(Times{1, 1.06, 1, 1, 1}));
  EXPECT_FALSE(is_steady(Times{1, 0.94, 1, 1, 1}));
}

TEST(Steady, WarmUpEndsWhenTimesSettleAndNotBefore) {
  // a clock that rises: 10, 5, 3.3, ... settles when 1/n falls by less than 5 % over five draws
  int n = 0;
  const WarmUp rising = warm_up_until_steady(2, [&] { return ++n <= 10 ? 10.0 / n : 1.0; });
  EXPECT_TRUE(rising.steady);
  EXPECT_EQ(rising.draws, 14) << "the tenth draw is the first of five that agree";
  const WarmUp never = warm_up_until_steady(3, [&] { return ++n % 2 == 0 ? 1.0 : 2.0; });
  EXPECT_FALSE(never.steady);
  EXPECT_EQ(never.draws, 63);
  EXPECT_EQ(warm_up_until_steady(8, [] { return 1.0; }).draws, 8);
}

TEST(Clocks, AnotherThanTheCommonOneIsMarked) {
  using Clocks = std::vector<std::optional<double>>;
  EXPECT_THAT(under_other_clock(Clocks{1980, 1980, 1500, 1970, std::nullopt}), ElementsAre(false, false, true, false, false));
  EXPECT_THAT(under_other_clock(Clocks{std::nullopt, std::nullopt}), ElementsAre(false, false));
  EXPECT_THAT(under_other_clock(Clocks{1000, 1021, 1000}), ElementsAre(false, true, false));
}

TEST(Clocks, SamplesUnderAnotherStayInTheListAndLeaveTheMedian) {
  GpuTimes times;
  times.samples_ms = {2, 8, 2, 4};
  times.clocks_mhz = {1980, 600, 1980, 1980};
  times.draws_per_query = 3;
  times.timer = {32, 480};
  const Json json = gpu_frame_json(times);
  EXPECT_EQ(json.at("all_gpu_ms"), Json({2, 8, 2, 4}));
  EXPECT_EQ(json.at("other_clock"), Json({false, true, false, false}));
  EXPECT_EQ(json.at("samples_under_other_clock"), 1);
  EXPECT_EQ(json.at("gpu_ms").at("median"), 2);
  EXPECT_EQ(json.at("gpu_ms").at("n"), 3);
  EXPECT_EQ(json.at("draws_per_query"), 3);
  EXPECT_EQ(json.at("gpu_timer").at("resolution_ns"), 32);
  EXPECT_TRUE(json.at("gpu_before").is_null()) << "nothing was read";
}

TEST(GpuStates, AreReadFromALineOfNvidiaSmi) {
  const GpuState state = parse_nvidia_smi("1980, 2619, 34, 0x0000000000000000\n");
  EXPECT_EQ(state.clock_mhz, 1980);
  EXPECT_EQ(state.memory_clock_mhz, 2619);
  EXPECT_EQ(state.temperature_c, 34);
  EXPECT_EQ(state.throttled, "no");
  EXPECT_EQ(parse_nvidia_smi("345, 2619, 30, 0x0000000000000001").throttled, "no") << "an idle GPU is not throttled";
  EXPECT_EQ(parse_nvidia_smi("1200, 2619, 88, 0x0000000000000060").throttled, "0x0000000000000060");
  EXPECT_FALSE(parse_nvidia_smi("1200, 2619, [N/A], [N/A]").temperature_c);
  for (const char* other : {"", "No devices were found", "a, b, c, d", "1,2,3"}) EXPECT_FALSE(parse_nvidia_smi(other).known()) << other;
}

TEST(GpuStates, AmdMarksItsClockWithAStar) {
  EXPECT_EQ(parse_amd_clock("0: 500Mhz\n1: 1800Mhz *\n2: 2400Mhz\n"), 1800);
  EXPECT_FALSE(parse_amd_clock("0: 500Mhz\n"));
  EXPECT_FALSE(parse_amd_clock(""));
}

class Machine : public testing::Test {
 protected:
  void SetUp() override {
    root_ = fs::path(testing::TempDir()) / fmt::format("amrtex_gpu_{}", ::getpid());
    fs::create_directories(root_ / "class/drm");
  }
  void TearDown() override { fs::remove_all(root_); }
  void write(const fs::path& name, const std::string& text) const {
    fs::create_directories((root_ / name).parent_path());
    std::ofstream(root_ / name) << text;
  }
  GlContextInfo gpu(const char* vendor) const {
    GlContextInfo info;
    info.vendor = vendor;
    info.device_file = "/dev/dri/renderD128";
    return info;
  }
  fs::path root_;
};

TEST_F(Machine, FilesOfAmdsDriverAreRead) {
  write("class/drm/renderD128/device/pp_dpm_sclk", "0: 500Mhz\n1: 2400Mhz *\n");
  write("class/drm/renderD128/device/pp_dpm_mclk", "0: 96Mhz\n1: 1000Mhz *\n");
  write("class/drm/renderD128/device/hwmon/hwmon3/temp1_input", "61000\n");
  const GpuState state = GpuStateReader(gpu("AMD"), "nvidia-smi", root_).read();
  EXPECT_EQ(state.clock_mhz, 2400);
  EXPECT_EQ(state.memory_clock_mhz, 1000);
  EXPECT_EQ(state.temperature_c, 61);
  EXPECT_EQ(state.source, (root_ / "class/drm/renderD128/device").string());
}

TEST_F(Machine, NvidiaSmiIsAskedForTheDeviceOnItsBus) {
  fs::create_directories(root_ / "0000:65:00.0");
  fs::create_directories(root_ / "class/drm/renderD128");
  fs::create_directory_symlink(root_ / "0000:65:00.0", root_ / "class/drm/renderD128/device");
  write("smi", "#!/bin/sh\necho \"$@\" > " + (root_ / "asked").string() + "\necho '1755, 2619, 41, 0x0000000000000004'\n");
  fs::permissions(root_ / "smi", fs::perms::owner_all);
  const GpuState state = GpuStateReader(gpu("NVIDIA Corporation"), (root_ / "smi").string(), root_).read();
  EXPECT_EQ(state.clock_mhz, 1755);
  EXPECT_EQ(state.throttled, "0x0000000000000004");
  std::ifstream asked(root_ / "asked");
  std::string words;
  std::getline(asked, words);
  EXPECT_THAT(words, HasSubstr("-i 0000:65:00.0"));
}

TEST_F(Machine, NothingIsClaimedWhereTheMachineDoesNotTell) {
  EXPECT_FALSE(GpuStateReader(gpu("NVIDIA Corporation"), (root_ / "absent").string(), root_).read().known());
  EXPECT_TRUE(to_json(GpuState()).is_null());
  GlContextInfo software = gpu("Mesa");
  software.software = true;
  EXPECT_FALSE(GpuStateReader(software, "nvidia-smi", root_).read().known());
}

TEST(Timer, IsRefusedWhereItTellsNothingOfAGpu) {
  GlContextInfo info;
  info.renderer = "NVIDIA H200";
  info.timer_bits = 64;
  EXPECT_EQ(timer_refusal(info), "");
  info.timer_bits = 0;
  EXPECT_THAT(timer_refusal(info), HasSubstr("0 bits"));
  info.timer_bits = 64;
  info.software = true;
  info.renderer = "llvmpipe (LLVM 19)";
  EXPECT_THAT(timer_refusal(info), HasSubstr("llvmpipe (LLVM 19) draws on the CPU"));
}

// Queries are real here, whatever their times are worth: nanoseconds that grow with the work, and no error left behind.
TEST(Timer, RealQueriesMeasureThemselvesAndDraws) {
  Context& gl = context(ContextKind::egl);
  if (gl.info().timer_bits == 0) GTEST_SKIP() << timer_refusal(gl.info());
  const auto quality = measure_timer(gl);
  ASSERT_TRUE(quality);
  EXPECT_GT(quality->resolution_ns, 0);
  EXPECT_LT(quality->resolution_ns, 1e9);
  EXPECT_GE(quality->overhead_ns, 0);
  const AmrHierarchy h = nested(waves).hierarchy();
  GlPairs(1).for_each([&](const EncodingCase& c) {
    const EncodedField field = build(h, c);
    BuildRequest request = verify::build_request(c, {});
    const Structure structure(gl, field, request);
    Scene scene = small_scene(Mode::dvr, perspective(h.domain_upper() * 2.0, (h.domain_lower() + h.domain_upper()) * 0.5), Sampling::lattice);
    scene.transfer_function = peaks();
    Raycaster raycaster(gl, h, structure, scene);
    const Picture once = (raycaster.draw(), raycaster.read());
    const GpuTimes times = time_on_gpu(raycaster, 3, *quality, GpuStateReader(gl.info()));
    EXPECT_EQ(times.samples_ms.size(), 3u);
    for (const double ms : times.samples_ms) EXPECT_GE(ms, 0);
    EXPECT_EQ(raycaster.read().values, once.values) << "draws that are repeated change no picture";
  });
}

}  // namespace
}  // namespace amrtex::test
