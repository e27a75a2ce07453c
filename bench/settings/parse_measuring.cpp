#include "bench/settings/experiment_parser.hpp"

namespace amrtex {
namespace {

/// All members of an object, none of them an axis.
Choice members_of(const JsonNode& object) {
  Choice choice;
  for (auto& [key, node] : object.members()) choice.emplace_back(key, node);
  return choice;
}

void parse_reference(ExperimentParser& parser) {
  const auto node = parser.root.find("reference");
  if (!node) return;
  if (node->json().is_null()) {
    parser.experiment.reference.reset();
    return;
  }
  node->accept_keys(names_of(reference_settings().keys()));
  if (const auto step = node->find("step"); step && !step->json().is_null() && node->find("tolerance"))
    step->fail("stands in place of 'tolerance'; accepted: one of both");
  read_settings(*node, members_of(*node), reference_settings(), *parser.experiment.reference);
}

/// A bound of one's own, or the reason for none.
void require_check(const ExperimentParser& parser) {
  const auto node = parser.root.find("check");
  if (!node || node->json().is_null()) return;
  const auto bound = node->find("psnr_db"), why = node->find("why"), off = node->find("off");
  if (bound.has_value() == off.has_value())
    node->fail("one of the keys 'psnr_db' (a bound of your own) and 'off' (why pictures are not checked) is needed");
  if (off && why) why->fail("belongs to 'psnr_db'; accepted: the reason as the value of 'off'");
  if (off && off->text().empty()) off->fail("accepted: the reason why pictures are not checked");
}

/// The checks that need a reference say which key asks for what is not there.
void require_reference(const ExperimentParser& parser) {
  const Experiment& e = parser.experiment;
  const auto refuse = [&](const char* key, const char* why) { parser.root.require(key).fail(why); };
  if ((e.minimum_psnr_db || e.unchecked_because) && e.reference && !e.reference->own)
    refuse("check", "pictures are checked against their own reference; accepted: null where 'reference' has 'own' false");
  if (!e.explain_error) return;
  if (!e.reference) refuse("explain_error", "a picture without a reference has no error to explain");
  if (!e.reference->own)
    refuse("explain_error",
           "what is explained is the error against the own reference; accepted: false where 'reference' has 'own' false");
  if (e.reference->shading)
    refuse("explain_error", "the causes are those of the picture's own shading; accepted: 'reference' without 'shading'");
}

void parse_region(ExperimentParser& parser, const JsonNode& node) {
  Scene scene;
  const Setting<Scene>& row = *scene_settings().find("region");
  const auto set = [&](const Json& value) {
    if (const auto problem = value_problem(value, row.key.type)) node.below(problem->place).fail(problem->text);
    row.set(scene, value);
  };
  // the two corners may stand in a list
  if (node.json().is_array() && node.json().size() == 2)
    set({{"lower", node.json()[0]}, {"upper", node.json()[1]}});
  else
    set(node.json());
  if (const auto found = scene_settings().complaint(row, scene)) node.fail(found->problem.text);
  parser.experiment.region = scene.region;
}

}  // namespace

void parse_measuring(ExperimentParser& parser) {
  parse_reference(parser);
  Experiment& e = parser.experiment;
  const bool named = parser.root.find("name").has_value();
  if (!named && !parser.scene) parser.root.require("name");
  for (const Setting<Experiment>& row : experiment_settings().rows())
    if (const auto node = parser.root.find(row.key.name)) read_setting(*node, row, e);
  if (!named) e.name = parser.file.path().stem().string();
  if (e.name.empty()) (named ? parser.root.require("name") : parser.root).fail("an empty name");
  require_check(parser);
  require_reference(parser);
  for (RenderPoint& render : e.renders)
    if (render.settings.ray_offset) render.settings.ray_offset = static_cast<std::uint32_t>(e.seed ^ e.seed >> 32);
  if (const auto region = parser.root.find("region")) parse_region(parser, *region);
}

}  // namespace amrtex
