#include <fmt/format.h>
#include <fmt/ranges.h>
#include <stdlib.h>  // setenv

#include <vector>

#include "bench/cli/commands.hpp"
#include "renderers/context/context_probe.hpp"

namespace amrtex {
namespace {

using namespace std::chrono_literals;

/// A way to get a context, and for zink the environment that chooses the driver.
struct Way {
  const char* name;
  ContextChoice choice;
  bool zink;
};

std::vector<Way> ways() {
  return {{"egl", ContextKind::egl, false},
          {"egl_device", ContextKind::egl_device, false},
          {"osmesa", ContextKind::osmesa, false},
          {"egl, software driver zink", ContextKind::egl, true}};
}

ContextProbe probe(const Way& way) {
  if (!way.zink) return probe_context(way.choice, 20s);
  const ChildResult child = run_in_child(
      [] {
        setenv("LIBGL_ALWAYS_SOFTWARE", "1", 1);
        setenv("MESA_LOADER_DRIVER_OVERRIDE", "zink", 1);
        return to_json(make_context(ContextKind::egl)->info()).dump();
      },
      60s);
  ContextProbe result;
  result.ok = child.ok;
  result.timed_out = child.timed_out;
  result.reason = child.reason;
  if (child.ok) result.info = context_info_from_json(Json::parse(child.text));
  return result;
}

Json encodings_json(const ContextInfo* context) {
  Json list = Json::array();
  for (const Encoding* e : all_encodings()) {
    Json entry;
    entry["name"] = e->name();
    entry["filters"] = Json::array();
    for (Filter f : e->filters()) entry["filters"].push_back(filter_name(f));
    entry["parameters"] = Json::array();
    for (const ParameterInfo& p : e->parameters()) entry["parameters"].push_back(to_json(p));
    const Support support = context != nullptr ? e->supported(*context) : Support{false, "no GL context on this machine"};
    entry["unsupported_values"] = Json::array();
    if (context != nullptr)
      for (const UnsupportedValue& v : e->unsupported_values(*context))
        entry["unsupported_values"].push_back({{"parameter", v.parameter}, {"value", v.value}, {"reason", v.reason}});
    entry["supported"] = support.ok;
    entry["reason"] = support.ok ? Json(nullptr) : Json(support.reason);
    list.push_back(entry);
  }
  return list;
}

void print_unsupported_values(const Json& entry, std::string_view before) {
  for (const Json& v : entry["unsupported_values"])
    fmt::print("{} {} {}: {}\n", before, v["parameter"].get<std::string>(), v["value"].dump(), v["reason"].get<std::string>());
}

int print_encodings(bool json) {
  const ContextProbe egl = probe_context(ContextKind::egl, 20s);
  const ContextProbe osmesa = egl.ok ? egl : probe_context(ContextKind::osmesa, 20s);
  const Json list = encodings_json(osmesa.ok ? &osmesa.info : nullptr);
  if (json) {
    fmt::print("{}\n", list.dump(2));
    return 0;
  }
  for (const Json& e : list) {
    std::vector<std::string> filters = e["filters"];
    fmt::print("{}\n  filters: {}\n", e["name"].get<std::string>(), fmt::join(filters, ", "));
    for (const Json& p : e["parameters"])
      fmt::print("  {}: {}; {} (default {})\n", p["name"].get<std::string>(), p["description"].get<std::string>(),
                 p["accepted"].get<std::string>(), p["default"].dump());
    if (!e["supported"].get<bool>()) fmt::print("  cannot run here: {}\n", e["reason"].get<std::string>());
    print_unsupported_values(e, "  cannot run here with");
  }
  return 0;
}

/// "no memory query", or what is free.
std::string memory_text(const GlContextInfo& i) {
  if (i.total_memory_bytes > 0) return fmt::format("{} bytes, {} free", i.total_memory_bytes, i.free_memory_bytes);
  return i.free_memory_bytes > 0 ? fmt::format("{} bytes free", i.free_memory_bytes) : "the driver does not tell";
}

void print_context(const std::string& name, const ContextProbe& p) {
  fmt::print("{}\n", name);
  if (!p.ok) {
    fmt::print("  not available: {}\n", p.reason);
    return;
  }
  const GlContextInfo& i = p.info;
  fmt::print("  renderer            {} ({})\n  vendor              {}\n  GL                  {}, GLSL {}\n", i.renderer,
             i.software ? "software" : "hardware", i.vendor, i.version, i.glsl_version);
  fmt::print("  GPU memory          {}\n", memory_text(i));
  fmt::print("  3D texture          {} texels an axis, {}\n  storage block       {} bytes, {} bindings\n", i.max_3d_texture_size,
             i.has_texture_limit() ? fmt::format("{} bytes", i.max_texture_bytes) : "no limit of bytes known", i.max_buffer_bytes,
             i.max_storage_bindings);
  fmt::print("  texture units       {}\n  viewport            {} x {}\n  timer               {} bits\n", i.max_texture_units,
             i.max_viewport_width, i.max_viewport_height, i.timer_bits);
  fmt::print("  bindless textures   {}\n  shader ballot       {}\n  extensions          {}\n", i.bindless_texture ? "yes" : "no",
             i.shader_ballot ? "yes" : "no", i.extensions.size());
  if (i.bindless_texture)
    fmt::print("  texture handles     {}{}\n",
               i.has_handle_limit() ? fmt::format("{} at most", i.max_resident_handles) : "no limit known",
               i.handles_may_differ ? "" : ", served in turn where they differ");
  for (const Json& e : encodings_json(&i)) {
    fmt::print("  encoding {:11} {}\n", e["name"].get<std::string>(),
               e["supported"].get<bool>() ? "can run" : "cannot run: " + e["reason"].get<std::string>());
    print_unsupported_values(e, "                       not with");
  }
}

Json probe_json(const ContextProbe& p) {
  Json entry;
  entry["available"] = p.ok;
  entry["reason"] = p.ok ? Json(nullptr) : Json(p.reason);
  if (p.ok) {
    entry["info"] = to_json(p.info);
    entry["encodings"] = encodings_json(&p.info);
  }
  return entry;
}

/// Every device of EGL's list, usable or not.
Json probe_all_devices(bool print) {
  Json list = Json::array();
  std::string reason;
  for (const ListedDevice& device : probe_devices(20s, reason)) {
    const ContextProbe p = probe_context({ContextKind::egl_device, device.index}, 20s);
    Json entry = probe_json(p);
    entry["device"] = device.index;
    entry["name"] = device.text;
    list.push_back(entry);
    if (print) print_context(fmt::format("device {}, with --context egl_device --device {}", device.text, device.index), p);
  }
  if (print && list.empty()) fmt::print("devices\n  none: {}\n", reason);
  return list;
}

int doctor(bool json) {
  Json all = Json::object();
  bool any = false;
  for (const Way& way : ways()) {
    const ContextProbe p = probe(way);
    any = any || p.ok;
    all[way.zink ? "egl_zink" : way.name] = probe_json(p);
    if (!json) print_context(fmt::format("context {}", way.name), p);
  }
  all["devices"] = probe_all_devices(!json);
  for (const Json& device : all["devices"]) any = any || device.at("available").get<bool>();
  if (json) fmt::print("{}\n", all.dump(2));
  return any ? 0 : 1;
}

}  // namespace

void require_support(const Encoding& encoding, const ContextInfo& context) {
  const Support support = encoding.supported(context);
  if (!support.ok) throw UnsupportedError(fmt::format("encoding {}: {}", encoding.name(), support.reason));
}

void add_context_commands(CLI::App& app, Command& chosen) {
  auto json = std::make_shared<bool>(false);
  CLI::App* encodings = app.add_subcommand("encodings", "what encodings there are, their filters and parameters");
  encodings->add_flag("--json", *json, "for programs");
  encodings->footer("Example: amrtex encodings --json");
  encodings->callback([json, &chosen] { chosen = [json] { return print_encodings(*json); }; });
  CLI::App* doc = app.add_subcommand("doctor", "what the GL contexts of this machine can do, and why not");
  doc->add_flag("--json", *json, "for programs");
  doc->footer("Example: amrtex doctor");
  doc->callback([json, &chosen] { chosen = [json] { return doctor(*json); }; });
}

}  // namespace amrtex
