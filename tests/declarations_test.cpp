// What an encoding declares, parameters and parts, and what follows from it.
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <limits>

#include "structures/common/layout.hpp"
#include "structures/common/parameter.hpp"
#include "tests/encoding_cases.hpp"

namespace amrtex {
namespace {

using namespace test;
using testing::AllOf;
using testing::ElementsAre;
using testing::HasSubstr;

// ---- parameters

TEST(Accepted, TellsItsValuesInWords) {
  EXPECT_EQ(choices({"pool", "bindless"}).text(), R"("pool" or "bindless")");
  EXPECT_EQ(choices({4, 8, 16}).text(), "4, 8 or 16");
  EXPECT_EQ(true_or_false().text(), "true or false");
  EXPECT_EQ(integers(2, 256).text(), "an integer from 2 to 256");
  EXPECT_EQ(either({nullptr}, {0}).text(), "null or an integer from 0");
  EXPECT_EQ(either({"auto", 0}, {.first = 2, .last = 1024, .powers_of_two = true}).text(),
            R"("auto", 0, or a power of two from 2 to 1024)");
  EXPECT_EQ((Accepted{{}, NumberRange{.first = 0.5, .last = 1.5, .whole = false}}.text()), "a number from 0.5 to 1.5");
}

TEST(Accepted, HasChoicesAsTheyAreWrittenAndNumbersOfItsRange) {
  const Accepted a = either({"auto", 0, nullptr}, {.first = 2, .last = 16, .powers_of_two = true});
  for (const Json& value : {Json("auto"), Json(0), Json(nullptr), Json(2), Json(16)}) EXPECT_TRUE(a.has(value)) << value;
  for (const Json& value : {Json("none"), Json(1), Json(3), Json(32), Json(-2), Json(2.0), Json(0.0), Json(false), Json::array()})
    EXPECT_FALSE(a.has(value)) << value;
  EXPECT_FALSE(choices({0, 1}).has(true));
  EXPECT_FALSE(true_or_false().has(1));
  const Accepted half{{}, NumberRange{.first = 0.5, .last = 1.5, .whole = false}};
  EXPECT_TRUE(half.has(1) && half.has(0.5) && half.has(1.5));
  EXPECT_FALSE(half.has(1.6) || half.has("1"));
}

TEST(Accepted, OfARangeWithoutALastNumberHasWhatAnIntHolds) {
  EXPECT_TRUE(integers(0).has(std::numeric_limits<int>::max()));
  EXPECT_FALSE(integers(0).has(std::int64_t{1} << 31));
  EXPECT_FALSE(integers(0).has(-1));
}

TEST(Accepted, GivesChoicesAndTheEndsOfItsRangeAsExamples) {
  EXPECT_THAT(either({"auto", 0}, {.first = 2, .last = 1024, .powers_of_two = true}).examples(),
              ElementsAre(Json("auto"), Json(0), Json(2), Json(1024)));
  EXPECT_THAT(either({nullptr}, {0}).examples(), ElementsAre(Json(nullptr))) << "the mesh tells how far it goes";
}

TEST(Parameters, AcceptTheirDefaultsTheirExamplesAndWhatIsCompared) {
  for (const Encoding* e : all_encodings())
    for (const ParameterInfo& p : e->parameters()) {
      SCOPED_TRACE(fmt::format("{} {}", e->name(), p.name));
      EXPECT_TRUE(p.accepted.has(p.default_value));
      std::vector<Json> values = p.accepted.examples();
      values.insert(values.end(), p.compared.begin(), p.compared.end());
      for (const Json& value : values) EXPECT_EQ(complete_parameters(*e, {{p.name, value}}).at(p.name), value);
    }
}

TEST(Parameters, AnswerEverythingElseWithNameValueAndWhatIsAccepted) {
  const std::vector<Json> odd{"no such name", -1, 1.5, 3, 1000000, true, nullptr, Json::array(), Json::object()};
  for (const Encoding* e : all_encodings())
    for (const ParameterInfo& p : e->parameters())
      for (const Json& value : odd) {
        if (p.accepted.has(value)) continue;
        SCOPED_TRACE(fmt::format("{} {} {}", e->name(), p.name, value.dump()));
        try {
          complete_parameters(*e, {{p.name, value}});
          ADD_FAILURE();
        } catch (const UsageError& error) {
          EXPECT_THAT(error.what(), AllOf(HasSubstr(std::string(e->name())), HasSubstr(p.name), HasSubstr(value.dump()),
                                          HasSubstr("accepted: " + p.accepted.text())));
        }
      }
}

TEST(Parameters, StandInJsonAsValues) {
  const Json json = to_json({"edge", "cells", 4, either({"auto"}, {.first = 2, .last = 8, .powers_of_two = true})});
  EXPECT_EQ(json, Json::parse(R"({"name": "edge", "description": "cells", "default": 4,
    "accepted": "\"auto\" or a power of two from 2 to 8", "choices": ["auto"],
    "range": {"first": 2, "last": 8, "whole": true, "powers_of_two": true}})"));
  EXPECT_EQ(to_json({"wrap", "", true, true_or_false()}).at("range"), nullptr);
  EXPECT_EQ(to_json({"level", "", nullptr, either({nullptr}, {0})}).at("range").at("last"), nullptr);
}

// ---- parts

/// Declares what a test says, and builds nothing.
class Declared final : public Encoding {
 public:
  std::string_view name() const override { return "declared"; }
  std::span<const Filter> filters() const override { return all_filters(); }
  EncodedField build(const AmrHierarchy&, const BuildRequest&) const override { return {}; }
};

/// A texture of 2 x 3 x 4 values, of which 20 are cells and 2 copies, for each field; a buffer of 10 words; bits that are absent.
Layout small_layout(const Encoding& encoding, const BuildRequest& request) {
  Layout layout(encoding, request);
  for (int number = 0; number < request.field_count(); ++number)
    layout.add(layout.values("tex_values", number, {2, 3, 4}).holding({.payload = 20, .duplicated = 2}));
  layout.add(buffer_part("words", "entries", TexelFormat::r32ui, 10));
  layout.add(buffer_part("bits", "validity bits", TexelFormat::r32ui, 3).when(false, "every cell has a value", Need::validity));
  layout.add(buffer_part("other", "others", TexelFormat::r32ui, 3).when(false));
  layout.leave_out({"validity bits", "every cell has a value", 8, Need::validity});
  layout.leave_out({"border layer", "nothing reads it", layout.value_bytes(5), Need::border});
  layout.add_working(1000);
  return layout;
}

TEST(Layout, AllocatesWhatIsPresentInOrderWithItsBytesByRole) {
  const Declared encoding;
  BuildRequest request;
  request.more_fields = {1};
  request.storage = Storage::r16;
  const Layout layout = small_layout(encoding, request);
  EXPECT_EQ(layout.bytes(), 2 * 24 * 2 + 40);
  EncodedField field;
  layout.allocate(field);
  ASSERT_EQ(field.textures.size(), 3u);
  EXPECT_EQ(field.textures[0].name, "tex_values");
  EXPECT_EQ(field.textures[1].name, "tex_values[1]");
  EXPECT_EQ(field.textures[1].roles, (MemoryByRole{40, 4, 0, 4}));
  EXPECT_TRUE(field.textures[0].holds_values);
  EXPECT_EQ(field.textures[2].roles, (MemoryByRole{0, 0, 40, 0})) << "a buffer is topology unless it says otherwise";
  EXPECT_EQ(field.memory().total(), layout.bytes());
  EXPECT_EQ(field.host_peak_bytes, layout.bytes() + 1000);
  EXPECT_EQ(field.parts.size(), 5u) << "the absent ones too";
}

TEST(Layout, ListsAbsentPartsWithAReasonOnceAName) {
  const Declared encoding;
  EncodedField field;
  small_layout(encoding, {}).allocate(field);
  ASSERT_EQ(field.left_out.size(), 2u);
  EXPECT_EQ(field.left_out[0].what, "validity bits");
  EXPECT_EQ(field.left_out[0].bytes, 12 + 8) << "the part, and a share of another";
  EXPECT_EQ(field.left_out[0].need, Need::validity);
  EXPECT_EQ(field.left_out[1].bytes, 5 * 4);
}

TEST(Layout, ABufferWithoutElementsTakesOne) {
  const Part part = buffer_part("none", "nothing", TexelFormat::rg32ui, 0);
  EXPECT_EQ(part.bytes(), 8);
  EXPECT_EQ(part.allocate().bytes(), 8);
}

template <class E, class F>
std::string refusal(F&& f) {
  try {
    f();
    return "taken";
  } catch (const E& e) {
    return e.what();
  }
}

TEST(Layout, NamesThePartThatALimitRefuses) {
  const Declared encoding;
  BuildRequest request;
  const auto limits = [&] { small_layout(encoding, request).require_limits(); };
  request.context.max_buffer_bytes = 40;
  request.context.max_3d_texture_size = 4;
  EXPECT_NO_THROW(limits());
  request.context.max_buffer_bytes = 39;
  EXPECT_THAT(refusal<UnsupportedError>(limits),
              AllOf(HasSubstr("encoding declared"), HasSubstr("entries: 40 bytes"), HasSubstr("39")));
  request.context.max_buffer_bytes = 40;
  request.context.max_3d_texture_size = 3;
  EXPECT_THAT(refusal<UnsupportedError>(limits), AllOf(HasSubstr("values: 2 x 3 x 4 texels"), HasSubstr("at most 3")));
  request.context.max_3d_texture_size = 4;
  request.context.max_texture_bytes = 96;
  EXPECT_NO_THROW(limits());
  request.context.max_texture_bytes = 95;
  EXPECT_THAT(refusal<UnsupportedError>(limits),
              AllOf(HasSubstr("values: 2 x 3 x 4 texels (96 bytes)"), HasSubstr("and 95 bytes")));
}

TEST(Layout, CountsPartsThatNoNumberHolds) {
  // (2^31)^3 texels: 2^93; the largest number stands for it, and no sum wraps round
  const Part part = texture_part("all", "all", TexelFormat::rg32ui, Vec3i(std::numeric_limits<int>::max()));
  EXPECT_EQ(part.bytes(), std::numeric_limits<std::int64_t>::max());
  const Declared encoding;
  BuildRequest request;
  Layout layout = small_layout(encoding, request);
  layout.add(part);
  EXPECT_EQ(layout.bytes(), std::numeric_limits<std::int64_t>::max());
}

TEST(Layout, NamesTheLargestPartWhereTheBudgetIsPassed) {
  const Declared encoding;
  BuildRequest request;
  const auto budget = [&] {
    Layout layout = small_layout(encoding, request);
    layout.set_remedy("; fewer words would do");
    layout.require_budget();
  };
  request.memory_limit = 24 * 4 + 40;
  EXPECT_NO_THROW(budget());
  --request.memory_limit;
  EXPECT_THAT(refusal<BudgetError>(budget),
              AllOf(HasSubstr("needs 136 bytes"), HasSubstr("limit is 135 bytes"), HasSubstr("most of it: values, 96 bytes"),
                    HasSubstr("; fewer words would do")));
}

TEST(Layout, RefusesSizesThatPass63BitsInsteadOfWrappingRound) {
  const Declared encoding;
  BuildRequest request;
  request.memory_limit = CheckedSize::kMost - 1;
  request.context.max_buffer_bytes = CheckedSize::kMost;
  // 2^21 texels along each axis are 2^63, and 2^62 words are 2^64 bytes
  const Part texture = texture_part("tex_values", "values", TexelFormat::r8, Vec3i(1 << 21));
  const Part buffer = buffer_part("words", "entries", TexelFormat::r32ui, std::int64_t{1} << 62);
  for (const Part& part : {texture, buffer}) {
    EXPECT_EQ(part.bytes(), CheckedSize::kMost) << part.name;
    Layout layout(encoding, request);
    layout.add(part);
    layout.add(buffer_part("more", "others", TexelFormat::r32ui, 1));
    layout.add_working(1);
    EXPECT_EQ(layout.bytes(), CheckedSize::kMost);
    EXPECT_THROW(layout.require_budget(), BudgetError);
    EXPECT_THROW(layout.require_limits(), UnsupportedError) << "a buffer's elements are counted in 31 bits";
  }
  EXPECT_EQ(Layout(encoding, request).value_bytes(std::int64_t{1} << 62), CheckedSize::kMost);
}

// ---- of every encoding

void expect_parts_are_what_is_there(const EncodedField& field) {
  auto texture = field.textures.begin();
  for (const Part& part : field.parts) {
    if (!part.present) {
      EXPECT_EQ(field.find(part.name), nullptr) << part.name;
      continue;
    }
    ASSERT_NE(texture, field.textures.end()) << part.name;
    EXPECT_EQ(texture->name, part.name);
    EXPECT_EQ(texture->kind, part.kind) << part.name;
    EXPECT_EQ(texture->bytes(), part.bytes()) << part.name;
    EXPECT_EQ(static_cast<std::int64_t>(texture->data.size()), part.bytes()) << part.name;
    EXPECT_FALSE(part.what.empty()) << part.name;
    ++texture;
  }
  EXPECT_EQ(texture, field.textures.end()) << texture->name << " was not declared";
}

TEST(Parts, AreTheTexturesAndBuffersOfEveryStructure) {
  const NamedMesh two{"two fields", nested(waves).also("g", slopes).hierarchy()};
  for (const EncodingCase& c : encoding_cases())
    for (const BuildOptions& options :
         {BuildOptions{}, BuildOptions{.value_ranges = false}, BuildOptions{.everything = true}, BuildOptions{.more_fields = {1}},
          BuildOptions{.draw_boxes = true}, BuildOptions{.level_of_detail = true}}) {
      SCOPED_TRACE(c.name());
      if (!accepted(two.hierarchy, c, options)) continue;
      const EncodedField field = build(two.hierarchy, c, options);
      expect_parts_are_what_is_there(field);
      EXPECT_GE(field.host_peak_bytes, field.memory().total());
      for (const LeftOut& entry : field.left_out) {
        EXPECT_FALSE(entry.why.empty()) << entry.what;
        EXPECT_GE(entry.bytes, 0) << entry.what;
      }
    }
}

TEST(Parts, AreNamedWhereABufferOfTheContextIsTooSmall) {
  const AmrHierarchy h = MeshBuilder(Vec3i(24)).root(waves).hierarchy();
  for (const EncodingCase& c : encoding_cases()) {
    SCOPED_TRACE(c.name());
    const EncodedField whole = build(h, c, {.validity = true});
    for (const Part& part : whole.parts) {
      if (!part.present || part.kind != HostTexture::Kind::buffer) continue;
      ContextInfo limits = c.limits;
      limits.max_buffer_bytes = part.bytes() - 1;
      try {  // others may take its place
        for (const HostTexture& t : build(h, c, {.limits = limits, .validity = true}).textures) {
          if (t.kind != HostTexture::Kind::buffer) continue;
          EXPECT_LT(t.bytes(), part.bytes()) << t.name;
        }
      } catch (const UnsupportedError& e) {
        const auto is_named = [&](const Part& p) { return std::string(e.what()).find(p.what + ": ") != std::string::npos; };
        EXPECT_TRUE(std::any_of(whole.parts.begin(), whole.parts.end(), is_named)) << e.what();
        EXPECT_THAT(e.what(), HasSubstr(fmt::format("at most {}", part.bytes() - 1)));
      }
    }
  }
}

}  // namespace
}  // namespace amrtex
