// The program `amrtex` as a user meets it: exit codes, messages, what it prints and what
// it leaves on disk.
#include <fcntl.h>
#include <fmt/format.h>
#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <spawn.h>
#include <stdlib.h>  // mkdtemp
#include <sys/wait.h>

#include <algorithm>
#include <cmath>
#include <filesystem>
#include <fstream>

#include "bench/numbers/image_error.hpp"
#include "bench/records/record.hpp"
#include "bench/records/record_file.hpp"
#include "bench/records/stored_picture.hpp"
#include "renderers/scene/picture.hpp"
#include "structures/generators/synthetic.hpp"
#include "structures/readers/amrex_plotfile/amrex_plotfile.hpp"

extern char** environ;

namespace amrtex {
namespace {

namespace fs = std::filesystem;
using testing::AllOf;
using testing::ElementsAre;
using testing::HasSubstr;
using testing::IsEmpty;
using testing::Not;
using testing::SizeIs;
using testing::StartsWith;

const std::string kData = AMRTEX_SOURCE_DIR "/data/amrex_tiny/plt00008";

struct Result {
  int exit_code = -1;  ///< minus the signal where it was killed
  std::string out, err;
};

std::string read_text(const fs::path& path) {
  std::ifstream file(path, std::ios::binary);
  return {std::istreambuf_iterator<char>(file), {}};
}

void write_text(const fs::path& path, const std::string& text) { std::ofstream(path, std::ios::binary) << text; }

std::vector<std::string> names_in(const fs::path& folder) {
  std::vector<std::string> names;
  for (const auto& entry : fs::directory_iterator(folder)) names.push_back(entry.path().filename());
  std::sort(names.begin(), names.end());
  return names;
}

class CommandLine : public testing::Test {
 protected:
  CommandLine() {
    std::string name = (fs::temp_directory_path() / "amrtex_command_line_XXXXXX").string();
    if (mkdtemp(name.data()) == nullptr) throw Error("no temporary folder");
    folder_ = name;
  }
  ~CommandLine() override { fs::remove_all(folder_); }

  fs::path at(const std::string& name) const { return folder_ / name; }

  Result amrtex(std::vector<std::string> arguments) const {
    arguments.insert(arguments.begin(), AMRTEX_PROGRAM);
    std::vector<char*> argv;
    for (std::string& a : arguments) argv.push_back(a.data());
    argv.push_back(nullptr);
    const std::string out = at(".out"), err = at(".err");
    posix_spawn_file_actions_t actions;
    posix_spawn_file_actions_init(&actions);
    posix_spawn_file_actions_addopen(&actions, 0, "/dev/null", O_RDONLY, 0);
    posix_spawn_file_actions_addopen(&actions, 1, out.c_str(), O_WRONLY | O_CREAT | O_TRUNC, 0600);
    posix_spawn_file_actions_addopen(&actions, 2, err.c_str(), O_WRONLY | O_CREAT | O_TRUNC, 0600);
    pid_t child = 0;
    const int error = posix_spawn(&child, AMRTEX_PROGRAM, &actions, nullptr, argv.data(), environ);
    posix_spawn_file_actions_destroy(&actions);
    if (error != 0) throw Error("cannot start " AMRTEX_PROGRAM);
    int status = 0;
    waitpid(child, &status, 0);
    return {WIFEXITED(status) ? WEXITSTATUS(status) : -WTERMSIG(status), read_text(out), read_text(err)};
  }

  Json json_of(const std::vector<std::string>& arguments) const {
    const Result r = amrtex(arguments);
    EXPECT_EQ(r.exit_code, 0) << r.err;
    return Json::parse(r.out);
  }

  std::string hash_of(const fs::path& data) const { return json_of({"info", data.string(), "--json"}).at("hash"); }

  /// Writes an experiment file and returns its path.
  std::string experiment_file(const Json& json) const {
    write_text(at("e.json"), json.dump(1));
    return at("e.json").string();
  }
  Result run(const Json& json, const std::vector<std::string>& options = {}) const {
    std::vector<std::string> arguments = {"run", experiment_file(json), "--out", at("out").string()};
    arguments.insert(arguments.end(), options.begin(), options.end());
    return amrtex(arguments);
  }
  Json counts_of_run(const Json& json) const {
    const Result r = run(json, {"--json"});
    EXPECT_EQ(r.exit_code, 0) << r.err;
    EXPECT_THAT(r.err, IsEmpty()) << "silence in a pipe";
    return Json::parse(r.out);
  }
  std::vector<Json> records() const { return load_records(at("out")); }
  fs::path record_file() const { return at("out") / "records.jsonl"; }

 private:
  fs::path folder_;
};

/// One line that says what was wrong, and no trace of a crash.
void expect_complaint(const Result& r, int exit_code, const testing::Matcher<const std::string&>& matcher) {
  EXPECT_EQ(r.exit_code, exit_code) << r.err;
  EXPECT_THAT(r.err, AllOf(StartsWith("amrtex: "), matcher));
  EXPECT_EQ(std::count(r.err.begin(), r.err.end(), '\n'), 1) << r.err;
  for (const char* trace : {"what()", "terminate", "#0", "json.exception", "std::"}) EXPECT_THAT(r.err, Not(HasSubstr(trace)));
}

Json small_experiment() {
  return {{"name", "small"},
          {"datasets", {{{"file", kData}, {"field", "phi"}}}},
          {"encodings", {{{"name", "uniform"}}, {{"name", "page_table"}, {"page_size", {8, 16}}}}},
          {"filters", {"linear_page"}},
          {"render", {{"sampling", "lattice"}, {"width", 32}, {"height", 32}}},
          {"views", {{{"eye", {2.2, 1.8, 1.5}}, {"at", {0.5, 0.5, 0.5}}, {"fov_y", 35}}}},
          {"transfer_function", {{"extinction", {{1.0, 0}, {1.9, 60}}}, {"color", {{1.0, 0, 0, 0.3}, {1.9, 0.8, 0, 0}}}}},
          {"frames", 2},
          {"warm_up", 0},
          {"reference", {{"step", 0.25}}}};
}

Json with(Json json, const std::string& key, const Json& value) {
  json[key] = value;
  return json;
}

Json one_point() { return with(small_experiment(), "encodings", {{{"name", "page_table"}}}); }

// --- usage ---

TEST_F(CommandLine, EveryCommandHasHelpWithAnExample) {
  for (const std::string command : {"encodings", "doctor", "info", "generate", "convert", "sample", "structure", "render", "run",
                                    "report", "compare", "merge", "verify", "advise", "settings"}) {
    const Result r = amrtex({command, "--help"});
    EXPECT_EQ(r.exit_code, 0) << command;
    EXPECT_THAT(r.out, HasSubstr("Example: amrtex " + command));
    EXPECT_THAT(r.err, IsEmpty());
    EXPECT_THAT(amrtex({"--help"}).out, HasSubstr("\n  " + command));
  }
}

TEST_F(CommandLine, FilesThatHelpNamesExist) {
  EXPECT_TRUE(fs::exists(AMRTEX_SOURCE_DIR "/experiments/limits/scene.json"));
  EXPECT_TRUE(fs::exists(AMRTEX_SOURCE_DIR "/experiments/quickstart/experiment.json"));
  EXPECT_TRUE(fs::exists(AMRTEX_SOURCE_DIR "/docs/experiments.md"));
  EXPECT_TRUE(fs::exists(AMRTEX_SOURCE_DIR "/docs/generate.md"));
}

TEST_F(CommandLine, UnknownCommandsAndOptionsNameTheAcceptedOnes) {
  expect_complaint(amrtex({}), 2, AllOf(HasSubstr("encodings"), HasSubstr("report")));
  expect_complaint(amrtex({"inform"}), 2, AllOf(HasSubstr("'inform'"), HasSubstr("info"), HasSubstr("run")));
  expect_complaint(amrtex({"info", kData, "--jsn"}), 2, AllOf(HasSubstr("'--jsn'"), HasSubstr("--json")));
  expect_complaint(amrtex({"info", kData, "more"}), 2, HasSubstr("'more'"));
  expect_complaint(amrtex({"run"}), 2, AllOf(HasSubstr("--out"), HasSubstr("amrtex run --help")));
  expect_complaint(amrtex({"run", "--out", at("out")}), 2, AllOf(HasSubstr("experiment"), HasSubstr("--from-record")));
}

TEST_F(CommandLine, UnknownNamesNameTheAcceptedOnes) {
  write_text(at("p"), "0.5 0.5 0.5\n");
  const auto sample = [&](const std::vector<std::string>& more) {
    std::vector<std::string> arguments = {"sample", kData, "--points", at("p").string()};
    arguments.insert(arguments.end(), more.begin(), more.end());
    return amrtex(arguments);
  };
  expect_complaint(amrtex({"info", kData, "--field", "rho"}), 2, AllOf(HasSubstr("'rho'"), HasSubstr("phi")));
  expect_complaint(sample({"--encoding", "octo", "--filter", "nearest"}), 2,
                   AllOf(HasSubstr("uniform"), HasSubstr("page_table")));
  expect_complaint(sample({"--encoding", "uniform", "--filter", "cubic"}), 2,
                   AllOf(HasSubstr("linear_vertex"), HasSubstr("basis")));
  const std::vector<std::string> known = {"--encoding", "page_table", "--filter", "nearest"};
  const auto also = [&](const std::string& option, const std::string& value) {
    std::vector<std::string> arguments = known;
    arguments.insert(arguments.end(), {option, value});
    return sample(arguments);
  };
  expect_complaint(also("--field", "rho"), 2, HasSubstr("phi"));
  expect_complaint(also("--storage", "r64"), 2, HasSubstr("r8, r16, r16f, r32f"));
  expect_complaint(also("--filtering", "soft"), 2, HasSubstr("hardware, manual"));
  expect_complaint(also("--context", "glx"), 2, HasSubstr("egl, egl_device, osmesa"));
  expect_complaint(also("--parameter", "page_size=5"), 2, AllOf(HasSubstr("page_table"), HasSubstr("4, 8, 16, 32, 64 or 128")));
  expect_complaint(also("--parameter", "size=8"), 2, HasSubstr("page_size, centring"));
  expect_complaint(also("--parameter", "page_size"), 2, HasSubstr("NAME=VALUE"));
}

TEST_F(CommandLine, VerifyRefusesUnknownSuitesAndContexts) {
  expect_complaint(amrtex({"verify", "--suite", "analytical"}), 2,
                   AllOf(HasSubstr("'analytical'"), HasSubstr("analytic, convergence, stiff, extreme, geometry, differential")));
  expect_complaint(amrtex({"verify", "--context", "vulkan"}), 2, AllOf(HasSubstr("vulkan"), HasSubstr("osmesa")));
}

TEST_F(CommandLine, VerifyWritesCasesAsJson) {
  const Result r = amrtex({"verify", "--suite", "stiff", "--json", "--context", "osmesa", "--out", at("verify").string()});
  ASSERT_EQ(r.exit_code, 0) << r.err;
  EXPECT_THAT(r.err, IsEmpty());
  const Json json = Json::parse(r.out);
  ASSERT_FALSE(json["cases"].empty());
  for (const Json& c : json["cases"]) {
    EXPECT_EQ(c["suite"], "stiff");
    EXPECT_TRUE(c["pass"].get<bool>()) << c.dump();
    for (const char* key : {"name", "encoding", "filter", "expected", "observed"}) EXPECT_TRUE(c.contains(key)) << key;
  }
  for (const Json& s : json["skipped"]) EXPECT_FALSE(s["reason"].get<std::string>().empty());
  EXPECT_EQ(Json::parse(read_text(at("verify") / "verify.json")), json);
  EXPECT_THAT(read_text(at("verify") / "table.md"),
              AllOf(HasSubstr(json["context"]["renderer"].get<std::string>()), HasSubstr("| 20 |")));
  EXPECT_THAT(read_text(at("verify") / "cases.csv"), HasSubstr("stiff,"));
}

TEST_F(CommandLine, VerifyRefusesAFolderThatCannotBeBeforeItWorks) {
  write_text(at("file"), "");
  expect_complaint(amrtex({"verify", "--out", (at("file") / "in").string()}), 1, HasSubstr("cannot be made"));
}

TEST_F(CommandLine, ErrorsAreOneLineOfAtMostFourHundredCharacters) {
  const std::string longest(20000, 'x');
  for (const std::vector<std::string>& arguments :
       {std::vector<std::string>{longest},
        {"info", longest},
        {"info", kData, longest},
        {"generate", longest, "-o", "x"},
        {"sample", kData, "--encoding", longest, "--filter", "nearest", "--points", "p"},
        {"sample", kData, "--encoding", "uniform", "--filter", longest, "--points", "p"},
        {"info", kData, "--field", longest},
        {"run", experiment_file(with(small_experiment(), longest, 1)), "--out", at("out").string()}}) {
    const Result r = amrtex(arguments);
    EXPECT_NE(r.exit_code, 0);
    EXPECT_THAT(r.err, StartsWith("amrtex: "));
    EXPECT_LE(r.err.size(), 401U) << arguments.front();
    EXPECT_EQ(std::count(r.err.begin(), r.err.end(), '\n'), 1) << r.err;
  }
}

TEST_F(CommandLine, NamesReachTheTerminalWithoutTheirEscapeSequences) {
  MeshDescription mesh = generate_mesh({{"field", "shell"}, {"levels", 1}, {"root", 4}, {"patch", 4}});
  write_amrex_plotfile(AmrHierarchy(mesh), at("mesh"));
  std::string header = read_text(at("mesh") / "Header");
  header.replace(header.find(mesh.fields[0]), mesh.fields[0].size(), "\x1b[31mred");
  write_text(at("mesh") / "Header", header);
  const Result table = amrtex({"info", at("mesh").string()});
  EXPECT_EQ(table.exit_code, 0) << table.err;
  EXPECT_THAT(table.out, AllOf(HasSubstr("\\x1b[31mred"), Not(HasSubstr("\x1b"))));
  const Result json = amrtex({"info", at("mesh").string(), "--json"});
  EXPECT_EQ(Json::parse(json.out)["fields"][0]["name"], "\x1b[31mred");
  EXPECT_THAT(json.out, Not(HasSubstr("\x1b")));
  expect_complaint(amrtex({"info", at("mesh").string(), "--field", "blue"}), 2, HasSubstr("its fields are \\x1b[31mred"));
}

TEST_F(CommandLine, MissingDataIsSaidClearly) {
  expect_complaint(amrtex({"info", at("none").string()}), 1, AllOf(HasSubstr(at("none").string()), HasSubstr("no such")));
  write_text(at("text"), "no mesh");
  expect_complaint(amrtex({"info", at("text").string()}), 1, HasSubstr("AMReX plotfile"));
  expect_complaint(amrtex({"run", at("none").string(), "--out", at("out").string()}), 1, HasSubstr(at("none").string()));
  expect_complaint(amrtex({"report", at("none").string()}), 1, HasSubstr(at("none").string()));
  expect_complaint(amrtex({"sample", kData, "--encoding", "uniform", "--filter", "nearest", "--points", at("none").string()}), 1,
                   HasSubstr(at("none").string()));
}

// --- meshes ---

TEST_F(CommandLine, InfoAgreesWithTheOracle) {
  const Json oracle = Json::parse(read_text(AMRTEX_SOURCE_DIR "/data/amrex_tiny/oracle.json"));
  const Json info = json_of({"info", kData, "--json"});
  ASSERT_THAT(info.at("levels"), SizeIs(3));
  for (std::size_t l = 0; l < 3; ++l) {
    const Json& level = info["levels"][l];
    EXPECT_EQ(level.at("level"), l);
    EXPECT_EQ(level.at("patches"), oracle["levels"][l]["grids"]);
    EXPECT_EQ(level.at("cells"), oracle["levels"][l]["cells"]);
    EXPECT_EQ(level.at("leaf_cells"), oracle["levels"][l]["leaf_cells"]);
    EXPECT_EQ(level.at("ratio_to_finer"), l < 2 ? 2 : 1);
  }
  EXPECT_EQ(info.at("leaf_cells"), oracle["total_leaf_cells"]);
  EXPECT_EQ(info.at("domain").at("lower"), Json({0.0, 0.0, 0.0}));
  EXPECT_EQ(info.at("domain").at("upper"), Json({1.0, 1.0, 1.0}));
  ASSERT_THAT(info.at("fields"), SizeIs(1));
  const Json& field = info["fields"][0];
  const Json& expected = oracle["fields"]["boxlib/phi"];
  EXPECT_EQ(field.at("name"), "phi");
  EXPECT_EQ(field.at("min"), expected["min"]);
  EXPECT_EQ(field.at("max"), expected["max"]);
  EXPECT_NEAR(field.at("volume_integral"), expected["sum_value_times_volume_code"], 1e-12);
  EXPECT_THAT(info.at("hash").get<std::string>(), SizeIs(testing::Ge(16U)));
}

TEST_F(CommandLine, InfoToRead) {
  const Result r = amrtex({"info", kData});
  EXPECT_EQ(r.exit_code, 0);
  EXPECT_THAT(r.out, AllOf(HasSubstr("leaf cells  25600"), HasSubstr("phi"), HasSubstr("ratio to finer")));
}

TEST_F(CommandLine, GenerateThenInfo) {
  const std::string spec = R"({"field": "shell", "levels": 3, "root": 16, "patch": 8})";
  const std::string mesh = at("shell");
  EXPECT_EQ(amrtex({"generate", spec, "-o", mesh}).exit_code, 0);
  const AmrHierarchy expected(generate_mesh(Json::parse(spec)));
  const Json info = json_of({"info", mesh, "--json"});
  EXPECT_EQ(info.at("leaf_cells"), expected.leaf_cells());
  EXPECT_EQ(info.at("fields")[0].at("name"), "shell");
  EXPECT_EQ(info.at("hash"), expected.content_hash(0));

  write_text(at("spec.json"), spec);
  EXPECT_EQ(amrtex({"generate", at("spec.json"), "-o", at("again")}).exit_code, 0);
  EXPECT_EQ(hash_of(at("again")), info.at("hash"));
  expect_complaint(amrtex({"generate", spec, "-o", mesh}), 1, HasSubstr("exists already"));
}

TEST_F(CommandLine, BadSpecificationsWriteNothing) {
  const std::string mesh = at("mesh");
  expect_complaint(amrtex({"generate", R"({"levls": 3})", "-o", mesh}), 2, AllOf(HasSubstr("levls"), HasSubstr("levels")));
  expect_complaint(amrtex({"generate", R"({"levels": 99})", "-o", mesh}), 2, AllOf(HasSubstr("levels"), HasSubstr("99")));
  expect_complaint(amrtex({"generate", R"({"levels": )", "-o", mesh}), 2, HasSubstr("not valid JSON"));
  expect_complaint(amrtex({"generate", at("none"), "-o", mesh}), 2, HasSubstr("a JSON file"));
  EXPECT_FALSE(fs::exists(mesh));
}

TEST_F(CommandLine, ConvertKeepsTheHash) {
  const std::string copy = at("copy");
  EXPECT_EQ(amrtex({"convert", kData, copy}).exit_code, 0);
  EXPECT_EQ(hash_of(copy), hash_of(kData));
  expect_complaint(amrtex({"convert", kData, copy}), 1, HasSubstr("exists already"));
  expect_complaint(amrtex({"convert", kData, at("other"), "--field", "rho"}), 2, HasSubstr("phi"));
  EXPECT_FALSE(fs::exists(at("other")));
}

TEST_F(CommandLine, ConvertWritesTheFormatOfTheEnding) {
  for (const char* name : {"copy.cells", "copy.npz"}) {
    EXPECT_EQ(amrtex({"convert", kData, at(name)}).exit_code, 0);
    EXPECT_EQ(hash_of(at(name)), hash_of(kData)) << name;
  }
  EXPECT_EQ(amrtex({"convert", kData, at("copy.vtkhdf")}).exit_code, 0);
  EXPECT_THAT(read_text(at("copy.vtkhdf")), HasSubstr("VTKHDF"));
  expect_complaint(amrtex({"convert", kData, at("copy.vti")}), 2, AllOf(HasSubstr("copy.vti"), HasSubstr("vtkhdf (.vtkhdf)")));
  expect_complaint(amrtex({"convert", kData, at("x"), "--format", "nzp"}), 2, AllOf(HasSubstr("'nzp'"), HasSubstr("'npz'")));
  EXPECT_FALSE(fs::exists(at("x")));
}

TEST_F(CommandLine, ConvertMakesLevelsOfAVolumeByWhatIsStated) {
  const fs::path volume = at("half_32x32x32_uint8.raw");
  std::string values(32 * 32 * 32, '\0');
  for (std::size_t i = 0; i < values.size(); ++i) values[i] = i % 32 < 16 ? '\0' : static_cast<char>(i * i % 101);
  write_text(volume, values);
  const auto leaf_cells = [&](const std::string& name, const std::vector<std::string>& stated) {
    std::vector<std::string> arguments = {"convert", volume, at(name)};
    arguments.insert(arguments.end(), stated.begin(), stated.end());
    EXPECT_EQ(amrtex(arguments).exit_code, 0) << name;
    return Json::parse(amrtex({"info", at(name), "--json"}).out).at("leaf_cells").get<int>();
  };
  EXPECT_EQ(leaf_cells("levels_1", {"--levels", "1"}), 32 * 32 * 32);
  EXPECT_EQ(leaf_cells("equal", {"--levels", "2", "--tolerance", "0"}), 16 * 32 * 32 + 8 * 16 * 16);
  EXPECT_EQ(leaf_cells("hidden", {"--levels", "2", "--tolerance", "0", "--transfer-function",
                                  R"({"extinction": [[200, 0], [255, 1]], "color": [[0, 1, 1, 1]]})"}),
            16 * 16 * 16);
  expect_complaint(amrtex({"convert", volume, at("x"), "--tolerance", "2"}), 2, AllOf(HasSubstr("tolerance 2"), HasSubstr("0 to 1")));
  expect_complaint(amrtex({"convert", kData, at("x"), "--levels", "2"}), 2, HasSubstr("volumes of equal cells"));
}

// --- contexts ---

TEST_F(CommandLine, EncodingsTellFiltersAndParameters) {
  const Json list = json_of({"encodings", "--json"});
  std::vector<std::string> names;
  for (const Json& e : list) {
    names.push_back(e.at("name"));
    EXPECT_THAT(e.at("filters"), Not(IsEmpty()));
    for (const Json& p : e.at("parameters"))
      for (const char* key : {"name", "description", "default", "accepted", "choices", "range"})
        EXPECT_TRUE(p.contains(key)) << p;
    EXPECT_NE(e.at("supported").get<bool>(), e.at("reason").is_string()) << e;
  }
  std::vector<std::string> expected;
  for (const Encoding* e : all_encodings()) expected.emplace_back(e->name());
  EXPECT_EQ(names, expected);
}

TEST_F(CommandLine, DoctorTellsWhatIsThereAndWhyNot) {
  const Json all = json_of({"doctor", "--json"});
  for (const char* kind : {"egl", "egl_device", "osmesa", "egl_zink"}) {
    const Json& entry = all.at(kind);
    if (entry.at("available").get<bool>()) {
      EXPECT_TRUE(entry.at("reason").is_null());
      EXPECT_FALSE(entry.at("info").at("renderer").get<std::string>().empty());
      EXPECT_THAT(entry.at("encodings"), SizeIs(all_encodings().size()));
    } else {
      EXPECT_FALSE(entry.at("reason").get<std::string>().empty()) << kind;
    }
  }
}

// --- sampling ---

TEST_F(CommandLine, SampleAgreesWithTheOracle) {
  const Json oracle = Json::parse(read_text(AMRTEX_SOURCE_DIR "/data/amrex_tiny/oracle.json"));
  const Json& expected = oracle["point_samples"]["samples"];
  std::string points = "# world units\n\n";
  for (const Json& s : expected) points += fmt::format("{} {} {}\n", s["p"][0].dump(), s["p"][1].dump(), s["p"][2].dump());
  write_text(at("p"), points);
  const Json samples =
      json_of({"sample", kData, "--encoding", "page_table", "--filter", "nearest", "--points", at("p"), "--json"});
  ASSERT_EQ(samples.size(), expected.size());
  for (std::size_t i = 0; i < samples.size(); ++i) {
    const double value = expected[i]["value"];
    EXPECT_EQ(samples[i].at("p"), expected[i]["p"]);
    EXPECT_EQ(samples[i].at("level"), expected[i]["level"]);
    EXPECT_EQ(samples[i].at("reference"), value);
    EXPECT_EQ(samples[i].at("encoding_double"), value);
    EXPECT_EQ(samples[i].at("encoding_gl"), static_cast<double>(static_cast<float>(value)));
  }
}

TEST_F(CommandLine, SampleOutsideIsNull) {
  write_text(at("p"), "0.51 0.52 0.53\n1.5 0 0\n");
  for (const auto& [encoding, filter, parameter] :
       std::vector<std::array<std::string, 3>>{{"uniform", "linear_page", "level=2"},
                                               {"page_table", "linear_page", "page_size=8"},
                                               {"page_table", "linear_vertex", "centring=node"}}) {
    const Json samples = json_of(
        {"sample", kData, "--encoding", encoding, "--filter", filter, "--parameter", parameter, "--points", at("p"), "--json"});
    ASSERT_THAT(samples, SizeIs(2));
    const double reference = samples[0].at("reference");
    EXPECT_NEAR(samples[0].at("encoding_double"), reference, 1e-12) << encoding << " " << filter;
    EXPECT_NEAR(samples[0].at("encoding_gl"), reference, 1e-6) << encoding << " " << filter;
    for (const char* key : {"level", "reference", "encoding_double", "encoding_gl"})
      EXPECT_TRUE(samples[1].at(key).is_null()) << key;
  }
}

/// Two cells of values 0 and 1 along x, their centres at 1/2 and 3/2.
const std::string kTwoCells =
    R"({"field": {"type": "step"}, "levels": 1, "root": [2, 1, 1], "domain": {"lower": [0, 0, 0], "upper": [2, 1, 1]}})";

TEST_F(CommandLine, SamplesInDoubleAreTakenAtThePointItself) {
  // between the centres f = x - 1/2, so 0.9 gives 0.4; the point as a context is given it is half a unit of float's last digit
  // off
  ASSERT_EQ(amrtex({"generate", kTwoCells, "-o", at("mesh")}).exit_code, 0);
  write_text(at("p"), "0.9 0.5 0.5\n1e300 0 0\n");
  for (const char* encoding : {"uniform", "page_table"}) {
    const Json samples =
        json_of({"sample", at("mesh"), "--encoding", encoding, "--filter", "linear_page", "--points", at("p"), "--json"});
    EXPECT_NEAR(samples[0].at("reference"), 0.4, 1e-15) << encoding;
    EXPECT_NEAR(samples[0].at("encoding_double"), 0.4, 1e-15) << encoding;
    const double p_gl = samples[0].at("p_gl")[0];
    EXPECT_EQ(p_gl, static_cast<double>(0.9F)) << "the fraction of the first cell as float";
    EXPECT_NEAR(samples[0].at("encoding_gl"), p_gl - 0.5, 0x1p-23) << encoding;
    EXPECT_TRUE(samples[1].at("p_gl").is_null());
  }
  const Result r = amrtex({"sample", at("mesh"), "--encoding", "uniform", "--filter", "linear_page", "--points", at("p")});
  EXPECT_THAT(r.out, AllOf(HasSubstr("GL point off"), HasSubstr("2.4e-08")));
}

TEST_F(CommandLine, SamplesOneUnitOffAFace) {
  // the face at 1 belongs to the upper cell; one unit of the last digit below it is still the lower one
  ASSERT_EQ(amrtex({"generate", kTwoCells, "-o", at("mesh")}).exit_code, 0);
  write_text(at("p"), fmt::format("{} 0.5 0.5\n1 0.5 0.5\n{} 0.5 0.5\n", std::nextafter(1.0, 0.0), std::nextafter(1.0, 2.0)));
  for (const char* encoding : {"uniform", "page_table", "octree", "kd_tree"}) {
    const Json samples =
        json_of({"sample", at("mesh"), "--encoding", encoding, "--filter", "nearest", "--points", at("p"), "--json"});
    for (const char* column : {"reference", "encoding_double", "encoding_gl"}) {
      EXPECT_EQ(samples[0].at(column), 0) << encoding << ", " << column;
      EXPECT_EQ(samples[1].at(column), 1) << encoding << ", " << column;
      EXPECT_EQ(samples[2].at(column), 1) << encoding << ", " << column;
    }
    EXPECT_LT(samples[0].at("p_gl")[0].get<double>(), 1) << "in its cell";
  }
}

TEST_F(CommandLine, SampleToRead) {
  write_text(at("p"), "0.51 0.52 0.53\n1.5 0 0\n");
  const Result r = amrtex({"sample", kData, "--encoding", "uniform", "--filter", "nearest", "--points", at("p")});
  EXPECT_EQ(r.exit_code, 0) << r.err;
  EXPECT_THAT(r.out, AllOf(HasSubstr("encoding double"), HasSubstr("encoding GL"), HasSubstr("0.53"), HasSubstr(" - ")));
  EXPECT_EQ(std::count(r.out.begin(), r.out.end(), '\n'), 3);
}

TEST_F(CommandLine, SampleSaysWhichLineIsNoPoint) {
  write_text(at("p"), "0.5 0.5 0.5\n0.5 0.5\n");
  expect_complaint(amrtex({"sample", kData, "--encoding", "uniform", "--filter", "nearest", "--points", at("p")}), 1,
                   AllOf(HasSubstr("line 2"), HasSubstr("x y z")));
}

TEST_F(CommandLine, SampleNeedsPointsToBeInAFile) {
  const auto sample = [&](const fs::path& points) {
    return amrtex({"sample", kData, "--encoding", "uniform", "--filter", "nearest", "--points", points.string()});
  };
  fs::create_directories(at("folder"));
  expect_complaint(sample(at("folder")), 1, HasSubstr("a folder, not a file"));
  write_text(at("empty"), "# none\n");
  expect_complaint(sample(at("empty")), 1, HasSubstr("no point"));
  write_text(at("long"), std::string(1 << 20, '1'));
  expect_complaint(sample(at("long")), 1, HasSubstr("line 1: 1048576 bytes"));
}

TEST_F(CommandLine, SampleWithAFilterThatTheEncodingLacks) {
  write_text(at("p"), "0.5 0.5 0.5\n");
  expect_complaint(amrtex({"sample", kData, "--encoding", "uniform", "--filter", "basis", "--points", at("p")}), 1,
                   HasSubstr("it has nearest, linear_page"));
}

// --- structure ---

std::vector<std::string> structure(const std::vector<std::string>& more) {
  std::vector<std::string> arguments = {"structure", kData, "--encoding", "page_table", "--filter", "nearest"};
  arguments.insert(arguments.end(), more.begin(), more.end());
  return arguments;
}

TEST_F(CommandLine, StructureTellsRegionsTexelsAndTheSamplesOfARay) {
  const Json shown = json_of(structure(
      {"--parameter", "page_size=8", "--ray", "-1", "0.5", "0.5", "1", "0", "0", "--sampling=lattice", "--texels", "--json"}));
  EXPECT_EQ(shown.at("build_parameters").at("page_size"), 8);
  std::int64_t bytes = 0, roles = 0;
  for (const Json& texture : shown.at("textures")) {
    bytes += texture.at("bytes").get<std::int64_t>();
    const std::vector<std::int64_t> size = texture.at("size");
    if (!texture.at("holds_values")) continue;
    EXPECT_EQ(static_cast<std::int64_t>(texture.at("values").size()), size[0] * size[1] * size[2]);
  }
  for (const Json& role : shown.at("memory")) roles += role.get<std::int64_t>();
  EXPECT_EQ(bytes, roles);
  EXPECT_THAT(shown.at("patches"), SizeIs(56));  // 8 + 24 + 24, data/README.md
  EXPECT_THAT(shown.at("samples"), SizeIs(64));  // finest cells along x
  EXPECT_GT(shown.at("samples")[1].at("p")[0], shown.at("samples")[0].at("p")[0]);
}

TEST_F(CommandLine, StructureToRead) {
  const Result r = amrtex(structure({}));
  EXPECT_EQ(r.exit_code, 0) << r.err;
  for (const char* word : {"page_table", "regions", "payload", "tex_"}) EXPECT_THAT(r.out, HasSubstr(word));
}

TEST_F(CommandLine, StructureRefusesRaysAndStepsThatAreNone) {
  expect_complaint(amrtex(structure({"--ray", "0", "0", "0", "0", "0", "0"})), 2, HasSubstr("not all 0"));
  expect_complaint(amrtex(structure({"--ray", "0", "0"})), 2, HasSubstr("--ray"));
  expect_complaint(amrtex(structure({"--step", "0"})), 2, AllOf(HasSubstr("--step 0"), HasSubstr("above 0")));
  expect_complaint(amrtex(structure({"--sampling", "random"})), 2, HasSubstr("lattice, adaptive"));
  expect_complaint(amrtex(structure({"--parameter", "page_size=5"})), 2, HasSubstr("4, 8, 16, 32, 64 or 128"));
}

// --- pictures ---

int big_endian(const std::string& bytes, std::size_t at) {
  int value = 0;
  for (std::size_t i = at; i < at + 4; ++i) value = value * 256 + static_cast<unsigned char>(bytes.at(i));
  return value;
}

TEST_F(CommandLine, RenderWritesPngAndFloats) {
  const std::string scene =
      experiment_file(with(one_point(), "render", {{"sampling", "adaptive"}, {"step", 0.5}, {"width", 40}, {"height", 24}}));
  EXPECT_EQ(amrtex({"render", scene, "-o", at("a.png")}).exit_code, 0);
  const std::string png = read_text(at("a.png"));
  EXPECT_THAT(png, StartsWith("\x89PNG"));
  EXPECT_EQ(big_endian(png, 16), 40);
  EXPECT_EQ(big_endian(png, 20), 24);

  EXPECT_EQ(amrtex({"render", scene, "-o", at("a.npy")}).exit_code, 0);
  EXPECT_EQ(amrtex({"render", scene, "-o", at("r.npy"), "--reference"}).exit_code, 0);
  const Picture picture = read_npy(at("a.npy"));
  const Picture reference = read_npy(at("r.npy"));
  EXPECT_EQ(picture.width, 40);
  EXPECT_EQ(picture.height, 24);
  EXPECT_EQ(picture.channels, 4);
  EXPECT_TRUE(reaches_psnr(compare(picture, reference), 45)) << compare(picture, reference).psnr_db.value_or(0);
  EXPECT_GT(*std::max_element(picture.values.begin(), picture.values.end()), 0.1) << "an empty picture";
}

TEST_F(CommandLine, RenderExplainsAPicturesErrorByCause) {
  const std::string scene = experiment_file(with(one_point(), "render", {{"mode", "projection"}, {"width", 16}, {"height", 16}}));
  const Result table = amrtex({"render", scene, "--explain-error"});
  EXPECT_EQ(table.exit_code, 0) << table.err;
  for (const char* cause : {"step", "encoding", "storage", "arithmetic", "driver", "filtering", "early_end", "filter"})
    EXPECT_THAT(table.out, HasSubstr(fmt::format("| {} |", cause)));
  const Result json = amrtex({"render", scene, "--explain-error", "--json"});
  const Json split = Json::parse(json.out).at("split");
  EXPECT_GT(split.at("step").at("rmse"), 0);
  EXPECT_LE(split.at("sum_closes"), 1e-12);
  expect_complaint(amrtex({"render", scene}), 2, HasSubstr("-o is missing"));
  expect_complaint(amrtex({"render", scene, "--json", "-o", at("a.png")}), 2, HasSubstr("--explain-error"));
  expect_complaint(amrtex({"render", scene, "--explain-error", "--reference"}), 2, HasSubstr("--reference"));
}

TEST_F(CommandLine, RenderDrawsADataSetWithoutAScene) {
  EXPECT_EQ(amrtex({"render", kData, "-o", at("a.png"), "--size", "48", "32", "--save-scene", at("s.json")}).exit_code, 0);
  EXPECT_GT(big_endian(read_text(at("a.png")), 16), 48) << "the bar stands beside the picture";
  EXPECT_EQ(big_endian(read_text(at("a.png")), 20), 32);
  EXPECT_EQ(amrtex({"render", at("s.json"), "-o", at("again.npy")}).exit_code, 0);
  EXPECT_EQ(amrtex({"render", kData, "-o", at("b.npy"), "--size", "48", "32"}).exit_code, 0);
  EXPECT_EQ(read_text(at("again.npy")), read_text(at("b.npy"))) << "the saved scene is what was drawn";
  const Picture picture = read_npy(at("b.npy"));
  double most = 0;
  for (int y = 0; y < picture.height; ++y)
    for (int x = 0; x < picture.width; ++x) most = std::max(most, picture.pixel(x, y)[3]);
  EXPECT_GT(most, 0.5) << "something is seen";
  EXPECT_EQ(amrtex({"render", kData, "-o", at("c.exr"), "--size", "16", "16", "--mode", "mip"}).exit_code, 0);
  EXPECT_EQ(
      amrtex({"render", kData, "-o", at("d.png"), "--size", "16", "16", "--isovalue", "1.1,1.3", "--no-color-bar"}).exit_code, 0);
  EXPECT_EQ(big_endian(read_text(at("d.png")), 16), 16);
}

TEST_F(CommandLine, RenderTakesTheCameraLinesOfOtherPrograms) {
  EXPECT_EQ(amrtex({"render", kData, "--save-scene", at("s.json"), "--camera", "3", "0.5", "0.5", "0.5", "0.5", "0.5", "0", "0",
                    "-1", "-fovy", "40"})
                .exit_code,
            0);
  const Json view = Json::parse(read_text(at("s.json"))).at("views");
  EXPECT_EQ(view.at("eye"), Json({3.0, 0.5, 0.5}));
  EXPECT_EQ(view.at("fov_y"), 40);
  EXPECT_EQ(view.at("up"), Json({0.0, 0.0, -1.0}));
}

TEST_F(CommandLine, RenderOfADataSetRefusesInOneLine) {
  expect_complaint(amrtex({"render", kData, "-o", at("a.png"), "--colormap", "jet"}), 2, HasSubstr("colour map"));
  expect_complaint(amrtex({"render", kData, "-o", at("a.png"), "--view", "top"}), 2, HasSubstr("corner"));
  expect_complaint(amrtex({"render", kData, "-o", at("a.png"), "--range", "2", "1"}), 2, HasSubstr("--range"));
  expect_complaint(amrtex({"render", kData, "-o", at("a.png"), "--mode", "dvt"}), 2, HasSubstr("dvr"));
  expect_complaint(amrtex({"render", kData, "-o", at("a.png"), "--field", "rho"}), 2, HasSubstr("phi"));
  const std::string scene = experiment_file(one_point());
  expect_complaint(amrtex({"render", scene, "-o", at("a.png"), "--view", "+x"}), 2, HasSubstr("--view"));
  expect_complaint(amrtex({"run", scene, "--out", at("r"), "--colormap", "gray"}), 2, HasSubstr("data set"));
}

TEST_F(CommandLine, InfoShowsAHistogram) { EXPECT_THAT(amrtex({"info", kData}).out, HasSubstr("share of the volume")); }

TEST_F(CommandLine, RenderOfAValueHasOneChannelAndAColorBar) {
  const std::string scene = experiment_file(with(one_point(), "render", {{"mode", "projection"}, {"width", 32}, {"height", 64}}));
  EXPECT_EQ(amrtex({"render", scene, "-o", at("a.npy")}).exit_code, 0);
  EXPECT_EQ(read_npy(at("a.npy")).channels, 1);
  EXPECT_EQ(amrtex({"render", scene, "-o", at("a.png"), "--color-bar"}).exit_code, 0);
  EXPECT_GT(big_endian(read_text(at("a.png")), 16), 32) << "the bar stands beside the picture";
}

TEST_F(CommandLine, RenderDrawsSurfacesColoredByASecondField) {
  Json scene = with(one_point(), "render", {{"mode", "iso"}, {"isovalues", {0.3}}, {"width", 32}, {"height", 32}});
  scene["render"]["surface_color"] = {{0, 1, 0, 0}, {1, 0, 0, 1}};
  scene["datasets"] = {
      {"generate", {{"field", "blobs"}, {"levels", 2}, {"root", 16}, {"patch", 4}, {"more_fields", {"linear"}}}}};
  EXPECT_EQ(amrtex({"render", experiment_file(scene), "-o", at("a.npy")}).exit_code, 0);
  scene["render"]["color_field"] = "linear";
  const Result drawn = amrtex({"render", experiment_file(scene), "-o", at("b.npy")});
  EXPECT_EQ(drawn.exit_code, 0) << drawn.err;
  const Picture a = read_npy(at("a.npy"));
  const Picture b = read_npy(at("b.npy"));
  EXPECT_GT(*std::max_element(a.values.begin(), a.values.end()), 0.1);
  EXPECT_NE(a.values, b.values);
  scene["render"]["color_field"] = "pressure";
  expect_complaint(amrtex({"render", experiment_file(scene), "-o", at("c.npy")}), 2,
                   AllOf(HasSubstr("pressure"), HasSubstr("blobs"), HasSubstr("linear")));
  EXPECT_FALSE(fs::exists(at("c.npy")));
}

TEST_F(CommandLine, AnIsovalueOutsideTheRangeIsAnEmptyPictureAndAWarning) {
  Json scene = with(one_point(), "render", {{"mode", "iso"}, {"isovalues", {1e9}}, {"width", 16}, {"height", 16}});
  const Result r = amrtex({"render", experiment_file(scene), "-o", at("a.npy")});
  EXPECT_EQ(r.exit_code, 0) << r.err;
  EXPECT_THAT(r.err, AllOf(HasSubstr("warning"), HasSubstr("isovalue"), HasSubstr("range of")));
  const Picture picture = read_npy(at("a.npy"));
  EXPECT_EQ(*std::max_element(picture.values.begin(), picture.values.end()), 0);
}

TEST_F(CommandLine, RenderReachesTheErrorThatItIsAskedFor) {
  Json json = with(one_point(), "render", {{"sampling", "adaptive"}, {"width", 24}, {"height", 24}});
  json["filters"] = {"linear_page"};
  const std::string scene = experiment_file(json);
  EXPECT_EQ(amrtex({"render", scene, "-o", at("a.npy"), "--tolerance", "1e-3"}).exit_code, 0);
  EXPECT_EQ(amrtex({"render", scene, "-o", at("r.npy"), "--reference"}).exit_code, 0);
  EXPECT_GE(share_within(pixel_errors(read_npy(at("a.npy")), read_npy(at("r.npy"))), 1e-3), 0.95);
}

TEST_F(CommandLine, SetReplacesWhatTheFileSays) {
  const std::string scene = experiment_file(one_point());
  EXPECT_EQ(amrtex({"render", scene, "-o", at("a.npy"), "--set", "width=7", "--set", "render.height=5"}).exit_code, 0);
  EXPECT_EQ(read_npy(at("a.npy")).width, 7);
  EXPECT_EQ(read_npy(at("a.npy")).height, 5);
  EXPECT_EQ(amrtex({"render", "--set", "width=6", scene, "-o", at("a.npy")}).exit_code, 0) << "one value an option";
  expect_complaint(amrtex({"render", scene, "-o", at("b.npy"), "--set", "render.step=0"}), 2,
                   HasSubstr("--set render.step=0: render.step: a number above 0"));
  expect_complaint(amrtex({"run", scene, "--out", at("out"), "--set", "stpe=1"}), 2, HasSubstr("did you mean 'step'?"));
  expect_complaint(amrtex({"run", scene, "--out", at("out"), "--set", "step=[1,2,3]", "--max-points", "2"}), 2,
                   HasSubstr("3 points"));
  EXPECT_FALSE(fs::exists(at("out"))) << "before any work";
}

TEST_F(CommandLine, SettingsListsTheKeysOfFilesAndWritesTheirTables) {
  const Result text = amrtex({"settings"});
  EXPECT_THAT(text.out, AllOf(HasSubstr("\nrender\n"), HasSubstr("\n  step ")));
  EXPECT_TRUE(Json::parse(amrtex({"settings", "--json"}).out).is_array());
  EXPECT_THAT(amrtex({"settings", "--markdown", "render"}).out, HasSubstr("| `step` |"));
  expect_complaint(amrtex({"settings", "--markdown", "rendr"}), 2, HasSubstr("render"));
  write_text(at("doc.md"), "<!-- settings:reference -->\n<!-- /settings:reference -->\n");
  EXPECT_EQ(amrtex({"settings", "--write", at("doc.md")}).exit_code, 0);
  EXPECT_THAT(read_text(at("doc.md")), HasSubstr("| `own` |"));
}

TEST_F(CommandLine, RenderRefusesWhatIsNoSceneOrNoPicture) {
  const std::string axes = experiment_file(small_experiment());
  expect_complaint(amrtex({"render", axes, "-o", at("a.png")}), 2, HasSubstr("encodings"));
  const std::string scene = experiment_file(one_point());
  expect_complaint(amrtex({"render", scene, "-o", at("a.tif")}), 2, AllOf(HasSubstr(".png"), HasSubstr(".npy")));
  expect_complaint(amrtex({"render", scene, "-o", at("a.png"), "--tolerance", "1e-3"}), 2,
                   AllOf(HasSubstr("--tolerance"), HasSubstr("adaptive, not lattice")));
  const std::string adaptive =
      experiment_file(with(one_point(), "render", {{"sampling", "adaptive"}, {"width", 8}, {"height", 8}}));
  expect_complaint(amrtex({"render", adaptive, "-o", at("a.png"), "--tolerance", "0"}), 2,
                   AllOf(HasSubstr("--tolerance"), HasSubstr("(0, 1]")));
  expect_complaint(amrtex({"render", scene, "-o", at("a.png"), "--memory-limit", "much"}), 2, HasSubstr("512MiB"));
  expect_complaint(amrtex({"render", scene, "-o", at("a.png"), "--memory-limit", "1KiB"}), 1, HasSubstr("bytes"));
  write_text(at("file"), "x");
  expect_complaint(amrtex({"render", scene, "-o", at("file") / "a.png"}), 1, HasSubstr("a.png"));
  EXPECT_FALSE(fs::exists(at("a.png")));
}

// --- experiments ---

TEST_F(CommandLine, RunWritesValidRecordsPicturesAndTables) {
  const Result r = run(small_experiment());
  EXPECT_EQ(r.exit_code, 0) << r.err;
  EXPECT_THAT(r.err, IsEmpty());
  EXPECT_THAT(r.out, AllOf(HasSubstr("| page_table (page_size 8) |"), HasSubstr("3 points measured, 0 kept")));
  const std::vector<Json> all = records();  // validates each
  ASSERT_THAT(all, SizeIs(3));
  for (const Json& record : all) {
    EXPECT_EQ(record.at("status"), "ok");
    EXPECT_EQ(record.at("experiment"), "small");
    EXPECT_EQ(record.at("dataset").at("hash"), hash_of(kData));
    EXPECT_EQ(record.at("frame").at("all_wall_ms").size(), 2U);
    EXPECT_GT(record.at("work").at("samples"), 0);
    EXPECT_GT(record.at("error").at("psnr_db"), 40);
    EXPECT_EQ(record.at("error_common").at("filter"), "linear_vertex");
    EXPECT_FALSE(record.at("image_hash").get<std::string>().empty());
    // the largest difference is a whole number of halves: exact but for its scale's rounding
    const std::string name = record.at("configuration");
    const auto difference = read_stored_picture(at("out") / "pictures" / (name + ".npz")).difference.value();
    EXPECT_DOUBLE_EQ(std::abs(*std::max_element(difference.values.begin(), difference.values.end(),
                                                [](double a, double b) { return std::abs(a) < std::abs(b); })),
                     record.at("error").at("max").get<double>());
    EXPECT_TRUE(fs::exists(at("out") / "pictures" / (name + ".png")));
  }
  EXPECT_THAT(names_in(at("out")),
              ElementsAre("pictures", "records.jsonl", "references", "shader_cache", "table.csv", "table.md", "table.tex"));
  EXPECT_THAT(names_in(at("out") / "pictures"), SizeIs(6)) << "two of each point";
}

TEST_F(CommandLine, RunGoesOnWhereItStopped) {
  EXPECT_EQ(counts_of_run(small_experiment()).at("measured"), 3);
  const std::string before = read_text(record_file());

  const Json kept = counts_of_run(small_experiment());
  for (const char* none : {"measured", "unsupported", "over_budget", "failed", "left"}) EXPECT_EQ(kept.at(none), 0) << none;
  EXPECT_EQ(kept.at("kept"), 3);
  EXPECT_EQ(read_text(record_file()), before);

  // as if it had been killed: the last line is cut off, and files that were being written are left
  write_text(record_file(), before.substr(0, before.size() - 100));
  write_text(at("out") / "pictures" / ".unfinished-aaaaaa", "half");
  const Result r = run(small_experiment(), {"--json"});
  const Json resumed = Json::parse(r.out);
  EXPECT_EQ(resumed.at("measured"), 1);
  EXPECT_EQ(resumed.at("kept"), 2);
  EXPECT_THAT(r.err, HasSubstr("records.jsonl:3: the last line is cut off"));
  EXPECT_TRUE(read_text(record_file()).starts_with(before.substr(0, before.rfind('\n', before.size() - 2))))
      << "a line was written again";
  EXPECT_THAT(names_in(at("out") / "pictures"), SizeIs(6)) << "two of each point";
  EXPECT_THAT(records(), SizeIs(3));
}

TEST_F(CommandLine, ForceMeasuresAgain) {
  EXPECT_EQ(counts_of_run(one_point()).at("measured"), 1);
  const std::string before = read_text(record_file());
  const Result r = run(one_point(), {"--force", "--json"});
  EXPECT_EQ(Json::parse(r.out).at("measured"), 1);
  EXPECT_EQ(Json::parse(r.out).at("kept"), 0);
  EXPECT_TRUE(read_text(record_file()).starts_with(before));
  EXPECT_GT(read_text(record_file()).size(), before.size());
  EXPECT_THAT(records(), SizeIs(1));
}

TEST_F(CommandLine, RunMeasuresThePointsThatOneChooses) {
  const Result chosen = run(small_experiment(), {"--where", "page_size = 8", "--json"});
  EXPECT_EQ(Json::parse(chosen.out).at("measured"), 1) << chosen.err;
  ASSERT_THAT(records(), SizeIs(1));
  EXPECT_EQ(records().front().at("build_parameters").at("page_size"), 8);
  const std::string whole = records().front().at("configuration");

  const Result listed = run(small_experiment(), {"--list-points"});
  EXPECT_EQ(std::count(listed.out.begin(), listed.out.end(), '\n'), 3);
  EXPECT_THAT(listed.out, AllOf(HasSubstr(whole + "  ok "), HasSubstr("  open ")));
  const Result dry = run(small_experiment(), {"--dry-run"});
  EXPECT_THAT(dry.out, AllOf(HasSubstr("3 points of 3 structures in 1 data sets, 2 of them open"), HasSubstr("to go")));
  EXPECT_THAT(records(), SizeIs(1)) << "neither measures";

  const Json only = Json::parse(run(small_experiment(), {"--only", whole.substr(0, 12), "--force", "--json"}).out);
  EXPECT_EQ(only.at("measured"), 1);
  expect_complaint(run(small_experiment(), {"--where", "page_sise = 8"}), 2,
                   AllOf(HasSubstr("--where"), HasSubstr("did you mean 'page_size'?")));
  expect_complaint(run(small_experiment(), {"--where", "page_size = 9"}), 2, HasSubstr("no point"));
}

TEST_F(CommandLine, RepetitionsAreRecordsOfTheirOwn) {
  EXPECT_EQ(Json::parse(run(one_point(), {"--repeat", "2", "--json"}).out).at("measured"), 2);
  std::set<int> repetitions;
  for (const Json& record : records()) repetitions.insert(record.at("repetition").get<int>());
  EXPECT_THAT(repetitions, ElementsAre(0, 1));
  EXPECT_EQ(Json::parse(run(one_point(), {"--repeat", "3", "--json"}).out).at("measured"), 1);
}

TEST_F(CommandLine, AFailureIsKeptAndStaysOneUntilItIsTriedAgain) {
  const Json impossible = with(one_point(), "check", Json{{"psnr_db", 900}});
  EXPECT_EQ(run(impossible).exit_code, 1);
  const Result kept = run(impossible, {"--json"});
  EXPECT_EQ(kept.exit_code, 1) << "a kept failure is no success";
  EXPECT_EQ(Json::parse(kept.out).at("failed"), 1);
  EXPECT_EQ(Json::parse(kept.out).at("measured"), 0);
  const std::string before = read_text(record_file());
  EXPECT_EQ(run(impossible, {"--retry-failed"}).exit_code, 1);
  EXPECT_GT(read_text(record_file()).size(), before.size());
}

TEST_F(CommandLine, ARecordIsMeasuredAgainFromItselfAlone) {
  EXPECT_EQ(counts_of_run(small_experiment()).at("measured"), 3);
  const std::vector<Json> before = records();
  for (const Json& record : before) {
    const std::string hash = record.at("configuration");
    fs::remove_all(at("again"));
    const Result r =
        amrtex({"run", "--from-record", record_file().string(), hash.substr(0, 10), "--out", at("again").string(), "--json"});
    EXPECT_EQ(Json::parse(r.out).at("measured"), 1) << r.err;
    const Json again = load_records(at("again")).at(0);
    EXPECT_EQ(again.at("configuration"), hash);
    EXPECT_EQ(again.at("image_hash"), record.at("image_hash"));
  }
  expect_complaint(amrtex({"run", "--from-record", record_file().string(), "zz", "--out", at("again").string()}), 2,
                   AllOf(HasSubstr("--from-record: 0 points"), HasSubstr("'zz'")));
}

TEST_F(CommandLine, NoTimeLeavesThePoints) {
  const Result r = run(small_experiment(), {"--time-limit", "1e-9", "--json"});
  EXPECT_EQ(r.exit_code, 0) << r.err;
  EXPECT_EQ(Json::parse(r.out).at("left"), 3);
  EXPECT_EQ(counts_of_run(small_experiment()).at("measured"), 3);
}

TEST_F(CommandLine, WithoutPicturesNoneAreKept) {
  EXPECT_EQ(run(one_point(), {"--no-pictures"}).exit_code, 0);
  EXPECT_FALSE(fs::exists(at("out") / "pictures"));
}

TEST_F(CommandLine, ADamagedReferenceIsDrawnAgain) {
  EXPECT_EQ(counts_of_run(one_point()).at("measured"), 1);
  const double psnr = records().front().at("error").at("psnr_db");
  for (const std::string& name : names_in(at("out") / "references")) write_text(at("out") / "references" / name, "damaged");
  EXPECT_EQ(Json::parse(run(one_point(), {"--force", "--json"}).out).at("measured"), 1);
  EXPECT_EQ(records().front().at("error").at("psnr_db"), psnr);
}

TEST_F(CommandLine, AFolderThatCannotBeWrittenEndsTheRunAndIsNoRecord) {
  fs::create_directories(at("out"));
  write_text(at("out") / "pictures", "a file in the way");
  expect_complaint(run(one_point()), 1, HasSubstr("pictures"));
  fs::remove(at("out") / "pictures");
  EXPECT_EQ(counts_of_run(one_point()).at("measured"), 1);
}

TEST_F(CommandLine, ReportMakesTheTablesFromRecordsAlone) {
  EXPECT_EQ(counts_of_run(small_experiment()).at("measured"), 3);
  const std::string table = read_text(at("out") / "table.md");
  for (const char* name : {"table.md", "table.csv", "table.tex", "pictures", "references"}) fs::remove_all(at("out") / name);
  const Result r = amrtex({"report", at("out")});
  EXPECT_EQ(r.exit_code, 0) << r.err;
  EXPECT_EQ(read_text(at("out") / "table.md"), table);
  EXPECT_THAT(r.out, HasSubstr("| page_table (page_size 16) |"));
  EXPECT_THAT(read_text(at("out") / "table.tex"), HasSubstr("\\toprule"));
  EXPECT_THAT(read_text(at("out") / "table.csv"), HasSubstr("page_table"));

  write_text(at("columns.json"), R"(["encoding", "total"])");
  EXPECT_THAT(amrtex({"report", at("out"), "--columns", at("columns.json")}).out, HasSubstr("| encoding | total (MiB) |"));
  write_text(at("columns.json"), R"(["encoding", "totl"])");
  expect_complaint(amrtex({"report", at("out"), "--columns", at("columns.json")}), 2,
                   AllOf(HasSubstr("totl"), HasSubstr("total")));
}

TEST_F(CommandLine, CompareAndMergeTakeWhatRunWrote) {
  const std::string out = at("out"), all = at("all");
  counts_of_run(small_experiment());
  const Result itself = amrtex({"compare", out, out, "--exit-code"});
  EXPECT_EQ(itself.exit_code, 0) << itself.err;
  EXPECT_THAT(itself.out, AllOf(HasSubstr("3 points with times"), HasSubstr("n too small: 1 against 1 cannot decide 3 rows"),
                                HasSubstr("0 exact values differ"), HasSubstr("that can decide 3 points: 5")));
  EXPECT_EQ(json_of({"merge", all, out, "--json"}), Json({{"added", 3}, {"present", 0}, {"renumbered", 0}, {"pictures", 3}}));
  EXPECT_EQ(json_of({"merge", all, out, "--json"}).at("present"), 3);
  EXPECT_EQ(json_of({"compare", out, all, "--json"}).at("findings"), false);
  EXPECT_EQ(amrtex({"report", all}).exit_code, 0);
  expect_complaint(amrtex({"compare", out, at("nowhere")}), 2, HasSubstr("nowhere"));
  expect_complaint(amrtex({"merge", all, at("nowhere")}), 1, HasSubstr("nowhere"));
  expect_complaint(amrtex({"compare", out, all, "--effect", "-1"}), 2, HasSubstr("a share from 0 to 1"));
}

TEST_F(CommandLine, TablesBesideAPaperFollowTheOrdinaryOnes) {
  const Json row{{"label", "memory"}, {"value", "/memory/total_bytes"}, {"paper", 123}};
  const Json table{{"title", "Table 7"}, {"datasets", "plt00008"}, {"where", {{"/encoding", "uniform"}}}, {"rows", {row}}};
  write_text(at("tables.json"), with(table, "titel", "").dump(1));
  expect_complaint(run(small_experiment()), 2, AllOf(HasSubstr("tables.json:"), HasSubstr("did you mean 'title'?")));
  EXPECT_FALSE(fs::exists(at("out"))) << "before any work";

  write_text(at("tables.json"), table.dump());
  EXPECT_EQ(counts_of_run(small_experiment()).at("measured"), 3);
  const std::string text = read_text(at("out") / "table.md");
  EXPECT_LT(text.find("### small"), text.find("### Table 7"));
  EXPECT_THAT(text, HasSubstr("| quantity | plt00008, ours | plt00008, paper |\n| --- | ---: | ---: |\n| memory | "));
  for (const char* name : {"table.md", "table.csv", "table.tex"}) fs::remove_all(at("out") / name);
  EXPECT_EQ(amrtex({"report", at("out")}).exit_code, 0);
  EXPECT_EQ(read_text(at("out") / "table.md"), text);
  EXPECT_THAT(read_text(at("out") / "table.tex"), HasSubstr("\\caption{Table 7."));
  EXPECT_THAT(read_text(at("out") / "table.csv"), HasSubstr("renderer,row,plt00008_ours,plt00008_paper"));

  write_text(at("out") / "tables.json", with(table, "where", Json::object()).dump());
  fs::remove(at("out") / "table.md");
  expect_complaint(amrtex({"report", at("out")}), 2,
                   AllOf(HasSubstr("row 'memory'"), HasSubstr("3 records"), HasSubstr("/encoding")));
  EXPECT_THAT(read_text(at("out") / "table.md"), HasSubstr("### small")) << "the ordinary tables need no tables.json";
}

TEST_F(CommandLine, CommittedResultsTakeTheTablesAndColumnsOfTheirExperiment) {
  EXPECT_EQ(counts_of_run(small_experiment()).at("measured"), 3);
  const Json row{{"label", "memory"}, {"value", "/memory/total_bytes"}, {"paper", 123}};
  const Json table{{"title", "Table 7"}, {"datasets", "plt00008"}, {"where", {{"/encoding", "uniform"}}}, {"rows", {row}}};
  const fs::path committed = at("committed"), results = committed / "results/part";
  fs::create_directories(results);
  fs::copy_file(at("out") / "records.jsonl", results / "records.jsonl");
  write_text(committed / "tables.json", Json::array({table}).dump());
  write_text(committed / "columns.json", R"(["encoding", "total"])");
  EXPECT_EQ(amrtex({"report", results.string()}).exit_code, 0);
  EXPECT_THAT(read_text(results / "table.md"), Not(HasSubstr("Table 7"))) << "no experiment above it";

  write_text(committed / "experiment.json", "{}");
  EXPECT_EQ(amrtex({"report", results.string()}).exit_code, 0);
  EXPECT_THAT(read_text(results / "table.md"), AllOf(HasSubstr("| encoding | total (MiB) |"), HasSubstr("### Table 7")));
}

TEST_F(CommandLine, WorkPrecisionIsATableAndADiagram) {
  write_text(at("tables.json"), R"([{"work_precision": {"reach": [20, 200]}}])");
  const Result r = run(small_experiment());
  EXPECT_EQ(r.exit_code, 0) << r.err;
  EXPECT_THAT(read_text(at("out") / "table.md"), AllOf(HasSubstr("| 20 dB |"), HasSubstr("no setting reaches 200 dB")));
  const Json diagram = Json::parse(read_text(at("out") / "work_precision_plt00008_view_1_transfer_function_1_dvr.vl.json"));
  EXPECT_THAT(diagram["vconcat"][0]["data"]["values"], SizeIs(3)) << "a point a structure";
  write_text(at("tables.json"), R"([{"work_precision": {"reach": "all"}}])");
  expect_complaint(run(small_experiment()), 2, AllOf(HasSubstr("tables.json:1:"), HasSubstr("reach")));
}

TEST_F(CommandLine, AnOrbitIsATableOfCorrelationsAndADiagram) {
  write_text(at("tables.json"), R"([{"title": "Orbit", "scatter": {"label": "regions", "value": "/work/regions",
      "against": {"label": "samples a ray", "value": "/work/samples", "over": "/work/rays"}}}])");
  const Json orbit{{"at", {0.5, 0.5, 0.5}}, {"radius", 3}, {"count", 4}, {"elevation", {-20, 40}}};
  Json experiment = with(small_experiment(), "views", Json{{"name", "round"}, {"orbit", orbit}});
  experiment["time_change"] = true;
  const Result r = run(experiment);
  EXPECT_EQ(r.exit_code, 0) << r.err;
  EXPECT_THAT(read_text(at("out") / "table.md"), AllOf(HasSubstr("### Orbit"), HasSubstr("4 views"), HasSubstr("correlation")));
  int diagrams = 0;
  for (const auto& entry : fs::directory_iterator(at("out")))
    if (entry.path().filename().string().starts_with("scatter_plt00008")) {
      ++diagrams;
      const Json panels = Json::parse(read_text(entry.path()))["hconcat"];
      EXPECT_THAT(panels[0]["layer"][1]["data"]["values"], SizeIs(4)) << "a point a view";
    }
  EXPECT_EQ(diagrams, 3) << "a diagram a structure";
  for (const Json& record : records()) {
    const Json& change = record.at("change");
    EXPECT_GT(change["wall_ms"]["median"].get<double>(), 0);
    EXPECT_GT(change["bytes"].get<int>(), 0);
  }
  write_text(at("tables.json"), R"([{"title": "Orbit", "scatter": {}}])");
  expect_complaint(run(experiment), 2, AllOf(HasSubstr("tables.json:1:"), HasSubstr("'label'")));
}

TEST_F(CommandLine, ABaselineThatCannotBeDrawnIsSaidOnce) {
  expect_complaint(run(with(with(small_experiment(), "baseline", true), "filters", {"linear_lod", "linear_page"})), 2,
                   AllOf(HasSubstr("e.json: baseline"), HasSubstr("no filter linear_lod"), HasSubstr("order")));
}

// --- advise ---

/// Few candidates and small pictures.
std::vector<std::string> advise_arguments(const std::vector<std::string>& more) {
  std::vector<std::string> arguments = {"advise",    kData,  "--filter",    "linear_lod", "--reference", "linear_lod",
                                        "--storage", "r32f", "--filtering", "manual",     "--width",     "64",
                                        "--height",  "64",   "--frames",    "1"};
  arguments.insert(arguments.end(), more.begin(), more.end());
  return arguments;
}

TEST_F(CommandLine, AdviseNamesASettingThatReachesTheErrorAndCanBeDrawn) {
  const Result r =
      amrtex(advise_arguments({"--tolerance", "0.02", "--memory-limit", "1MiB", "--json", "--scene", at("s.json").string()}));
  EXPECT_EQ(r.exit_code, 0) << r.err;
  EXPECT_THAT(r.err, IsEmpty()) << "silence in a pipe";
  const Json json = Json::parse(r.out);
  const Json& advice = json.at("advice");
  EXPECT_LE(advice.at("p95").get<double>(), 0.02);
  EXPECT_GT(advice.at("max").get<double>(), 0);
  EXPECT_LE(advice.at("bytes").get<std::int64_t>(), 1 << 20);
  EXPECT_EQ(advice.at("filter"), "linear_lod");
  EXPECT_FALSE(json.at("lost").empty());
  EXPECT_EQ(json.at("scene"), Json::parse(read_text(at("s.json"))));
  const Result drawn = amrtex({"render", at("s.json").string(), "-o", at("s.npy").string()});
  EXPECT_EQ(drawn.exit_code, 0) << drawn.err;
  EXPECT_EQ(read_npy(at("s.npy")).width, 64);
}

TEST_F(CommandLine, AdviseToReadSaysWhatWhyAndWhatElse) {
  const Result r = amrtex(advise_arguments({"--tolerance", "0.1", "--keep", at("kept").string()}));
  EXPECT_EQ(r.exit_code, 0) << r.err;
  EXPECT_THAT(r.out, AllOf(StartsWith("Take\n"), HasSubstr("MiB"), HasSubstr("95 % of the pixels"), HasSubstr("Not taken"),
                           HasSubstr("\"encodings\"")));
  EXPECT_THAT(load_records(at("kept")), Not(IsEmpty()));
}

TEST_F(CommandLine, AdviseEndsWithOneWhereNothingIsGoodEnough) {
  expect_complaint(amrtex(advise_arguments({"--memory-limit", "100"})), 1,
                   AllOf(HasSubstr("nothing fits into 100 bytes"), HasSubstr("the smallest structure needs")));
  const Result r = amrtex(advise_arguments({"--tolerance", "1e-9", "--json"}));
  expect_complaint(r, 1, AllOf(HasSubstr("nothing reaches the error 1e-09"), HasSubstr("the nearest has")));
  EXPECT_TRUE(Json::parse(r.out).at("advice").is_null());
}

TEST_F(CommandLine, AdviseRefusesBadUsageBeforeAnyWork) {
  struct Case {
    std::vector<std::string> arguments;
    const char *first, *second;
  };
  for (const Case& c : std::initializer_list<Case>{{{"--tolerance", "0"}, "--tolerance 0", "(0, 1]"},
                                                   {{"--tolerance", "2"}, "--tolerance 2", "(0, 1]"},
                                                   {{"--memory-limit", "much"}, "much", "512MiB"},
                                                   {{"--memory-limit", "0"}, "--memory-limit 0", "one byte"},
                                                   {{"--field", "rho"}, "rho", "phi"},
                                                   {{"--storage", "r64"}, "r64", "r32f"},
                                                   {{"--context", "vulkan"}, "vulkan", "osmesa"},
                                                   {{"--view", "{\"eye\": 3}"}, "views", "'eye'"},
                                                   {{"--transfer-function", "none.json"}, "none.json", "accepted"},
                                                   {{"--scene", "a.txt"}, "a.txt", ".json"},
                                                   {{"--scene", "no_folder/a.json"}, "no_folder", "folder"}})
    expect_complaint(amrtex(advise_arguments(c.arguments)), 2, AllOf(HasSubstr(c.first), HasSubstr(c.second)));
  expect_complaint(amrtex({"advise", at("nowhere").string()}), 2, HasSubstr("nowhere"));
  write_text(at("text"), "no mesh");
  expect_complaint(amrtex({"advise", at("text").string()}), 2, AllOf(HasSubstr("text"), HasSubstr("AMReX")));
}

TEST_F(CommandLine, ReportNamesABrokenRecord) {
  EXPECT_EQ(counts_of_run(one_point()).at("measured"), 1);
  const fs::path file = at("out") / "records.jsonl";
  write_text(file, "{\n" + read_text(file));
  const Result report = amrtex({"report", at("out")});
  EXPECT_EQ(report.exit_code, 0) << "the other records are whole";
  EXPECT_THAT(report.err, AllOf(HasSubstr("records.jsonl:1"), HasSubstr("left out")));
}

TEST_F(CommandLine, BrokenExperimentFilesNameLineAndKey) {
  const auto complaint = [&](const std::string& text) {
    write_text(at("e.json"), text);
    return amrtex({"run", at("e.json"), "--out", at("out")});
  };
  const std::string head = "{\n \"name\": \"x\",\n";
  const std::string mesh = " \"datasets\": [{\"generate\": {\"levels\": 1, \"root\": 16}}],\n";
  expect_complaint(complaint(head + " \"datasets\": [\n}"), 2, HasSubstr("e.json:4:"));
  expect_complaint(complaint(head + " \"dataset\": []\n}"), 2,
                   AllOf(HasSubstr("e.json:3:"), HasSubstr("did you mean 'datasets'")));
  expect_complaint(complaint(head + mesh + " \"encodings\": [{\"name\": \"octo\"}]\n}"), 2,
                   AllOf(HasSubstr("e.json:4:"), HasSubstr("encodings[0].name"), HasSubstr("page_table")));
  expect_complaint(complaint(head + mesh + " \"encodings\": [{\"name\": \"page_table\", \"page\": 8}]\n}"), 2,
                   AllOf(HasSubstr("e.json:4:"), HasSubstr("page_size")));
  const std::string valid = head + mesh + " \"encodings\": [{\"name\": \"uniform\"}],\n";
  expect_complaint(complaint(valid + " \"filters\": [\"nearest\", \"cubic\"]\n}"), 2,
                   AllOf(HasSubstr("e.json:5:"), HasSubstr("filters[1]"), HasSubstr("linear_vertex")));
  expect_complaint(complaint(valid + " \"storage\": \"r7\"\n}"), 2, AllOf(HasSubstr("e.json:5: storage"), HasSubstr("r16f")));
  Json bad = small_experiment();
  bad["render"]["step"] = "one";
  expect_complaint(run(bad), 2, HasSubstr("render.step"));
  expect_complaint(run(with(small_experiment(), "datasets", {{{"file", "no/mesh"}}})), 2,
                   AllOf(HasSubstr("datasets[0].file"), HasSubstr("no/mesh")));
  EXPECT_FALSE(fs::exists(at("out"))) << "exit 2 comes before any work";
}

TEST_F(CommandLine, ABadPageSizeIsBadUsage) {
  expect_complaint(run(with(small_experiment(), "encodings", {{{"name", "page_table"}, {"page_size", 5}}})), 2,
                   HasSubstr("4, 8, 16, 32, 64 or 128"));
}

TEST_F(CommandLine, AFilterThatAnEncodingLacksIsARecord) {
  const Result r = run(with(one_point(), "filters", {"basis", "linear_page"}));
  EXPECT_EQ(r.exit_code, 0) << r.err;
  EXPECT_THAT(r.out, HasSubstr("1 points measured, 0 kept, 1 unsupported"));
  int unsupported = 0;
  for (const Json& record : records()) {
    if (record.at("filter") != "basis") continue;
    ++unsupported;
    EXPECT_EQ(record.at("status"), "unsupported");
    EXPECT_THAT(record.at("reason").get<std::string>(), HasSubstr("nearest, linear_page, linear_vertex"));
    EXPECT_TRUE(record.at("frame").is_null());
  }
  EXPECT_EQ(unsupported, 1);
  EXPECT_THAT(read_text(at("out") / "table.md"), HasSubstr("unsupported: ")) << "the row stays";
}

TEST_F(CommandLine, AMemoryLimitIsARecord) {
  const Result r = run(one_point(), {"--memory-limit", "64KiB"});
  EXPECT_EQ(r.exit_code, 0) << r.err;
  ASSERT_THAT(records(), SizeIs(1));
  EXPECT_EQ(records()[0].at("status"), "over_budget");
  EXPECT_THAT(records()[0].at("reason").get<std::string>(), AllOf(HasSubstr("page_table"), HasSubstr("65536 bytes")));
  expect_complaint(run(one_point(), {"--memory-limit", "64kilo"}), 2, HasSubstr("512MiB"));
}

TEST_F(CommandLine, ATextureLargerThanTheContextIsARecordBeforeAllocation) {
  Json deep = with(one_point(), "datasets", {{{"generate", {{"field", "linear"}, {"levels", 9}, {"refine", "nested"}}}}});
  deep["encodings"] = {{{"name", "uniform"}}};
  EXPECT_EQ(run(deep).exit_code, 0);
  ASSERT_THAT(records(), SizeIs(1));
  EXPECT_EQ(records()[0].at("status"), "unsupported");
  EXPECT_THAT(records()[0].at("reason").get<std::string>(), HasSubstr("16384 x 16384 x 16384"));
  fs::remove_all(at("out"));
  EXPECT_EQ(run(deep, {"--memory-limit", "1GiB"}).exit_code, 0);
  EXPECT_EQ(records()[0].at("status"), "over_budget");
}

TEST_F(CommandLine, AWrongPictureFailsAndGetsNoTime) {
  Json coarse = with(one_point(), "check", {{"psnr_db", 200}});
  const Result r = run(coarse);
  EXPECT_EQ(r.exit_code, 1) << "a point that failed";
  ASSERT_THAT(records(), SizeIs(1));
  EXPECT_EQ(records()[0].at("status"), "failed");
  EXPECT_THAT(records()[0].at("reason").get<std::string>(), HasSubstr("psnr_db"));
  EXPECT_TRUE(records()[0].at("frame").is_null());
  EXPECT_FALSE(records()[0].at("error").is_null());
}

TEST_F(CommandLine, AFolderOfTheFirstSchemaIsNotRunInto) {
  EXPECT_EQ(counts_of_run(one_point()).at("measured"), 1);
  Json old = records().at(0);
  old["schema"] = "amrtex-record/1";
  fs::remove(at("out") / "records.jsonl");
  fs::create_directory(at("out") / "records");
  write_text(at("out") / "records" / "point.json", old.dump());
  expect_complaint(run(one_point()), 2,
                   AllOf(HasSubstr(at("out").string()), HasSubstr("older form"), HasSubstr("another folder")));
  EXPECT_EQ(amrtex({"report", at("out").string()}).exit_code, 0);
}

TEST_F(CommandLine, RecordsOfAnotherProgramAreMeasuredAgainUnlessTheyAreToBeKept) {
  EXPECT_EQ(counts_of_run(one_point()).at("measured"), 1);
  Json old = records().at(0);
  if (::getenv("MESA_SHADER_CACHE_DIR") == nullptr) {
    EXPECT_EQ(old.at("context").at("shader_cache"), "cold");
  }
  old["implementation"] = "older";
  write_text(at("out") / "records.jsonl", record_line(old) + "\n");
  EXPECT_EQ(Json::parse(run(one_point(), {"--json", "--keep-old"}).out).at("kept"), 1);
  EXPECT_EQ(counts_of_run(one_point()).at("measured"), 1);
  EXPECT_EQ(records().at(0).at("context").at("shader_cache"), "warm");
  expect_complaint(run(one_point(), {"--force", "--keep-old"}), 2, HasSubstr("--keep-old"));
}

TEST_F(CommandLine, AnOutputFolderThatCannotBeWrittenLeavesNothing) {
  write_text(at("file"), "mine");
  const std::string file = experiment_file(one_point());
  expect_complaint(amrtex({"run", file, "--out", at("file") / "out"}), 1, HasSubstr((at("file") / "out").string()));
  expect_complaint(amrtex({"run", file, "--out", at("file")}), 1, HasSubstr(at("file").string()));
  EXPECT_EQ(read_text(at("file")), "mine");
  EXPECT_THAT(names_in(at("")), ElementsAre(".err", ".out", "e.json", "file"));
}

}  // namespace
}  // namespace amrtex
