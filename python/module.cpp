// The extension module amrtex._core: values in and out, and nothing more. amrtex/__init__.py is what people call.
#include <fmt/format.h>
#include <pybind11/numpy.h>
#include <pybind11/pybind11.h>
#include <pybind11/stl.h>

#include <algorithm>

#include "bench/records/record.hpp"
#include "bench/records/record_file.hpp"
#include "bench/settings/bytes_text.hpp"
#include "python/runs.hpp"
#include "python/session.hpp"
#include "structures/mesh/quoted.hpp"
#include "structures/readers/mesh_io.hpp"
#include "structures/readers/write_mesh.hpp"

namespace amrtex {
namespace {

namespace py = pybind11;

using Mesh = HeldMesh;
using Points = py::array_t<double, py::array::c_style | py::array::forcecast>;
using Corners = py::array_t<std::int64_t, py::array::c_style>;
/// Columns first, so that x is fastest.
using Cells = py::array_t<double, py::array::f_style | py::array::forcecast>;

/// As Python's json reads it.
std::string text_of(const Json& json) { return json.dump(-1, ' ', false, Json::error_handler_t::replace); }

template <class T>
py::array numbers(const std::vector<T>& values, const std::vector<py::ssize_t>& shape) {
  return py::array_t<T>(shape, values.data());
}

py::array array_of(const Picture& picture, bool as_double) {
  const std::vector<py::ssize_t> shape = {picture.height, picture.width, picture.channels};
  const bool fits = std::all_of(picture.values.begin(), picture.values.end(),
                                [](double v) { return v != v || static_cast<double>(static_cast<float>(v)) == v; });
  if (as_double || !fits) return numbers(picture.values, shape);
  std::vector<float> values;
  values.reserve(picture.values.size());
  for (const double v : picture.values) values.push_back(static_cast<float>(v));
  return numbers(values, shape);
}

Picture picture_of(const Points& array) {
  if (array.ndim() != 3 || (array.shape(2) != 1 && array.shape(2) != 4) || array.size() == 0)
    throw UsageError("picture: accepted: an array of shape (height, width, 4) or (height, width, 1), as render returns it");
  constexpr py::ssize_t kMost = 1 << 16;
  if (array.shape(0) > kMost || array.shape(1) > kMost)
    throw UsageError(
        fmt::format("picture: {} x {} pixels; at most {} a side are accepted", array.shape(1), array.shape(0), kMost));
  Picture picture(static_cast<int>(array.shape(1)), static_cast<int>(array.shape(0)), static_cast<int>(array.shape(2)));
  std::copy_n(array.data(), array.size(), picture.values.begin());
  return picture;
}

std::vector<Vec3d> points_of(const Points& array) {
  if (array.ndim() != 2 || array.shape(1) != 3) throw UsageError("points: accepted: an array of shape (n, 3), world units");
  std::vector<Vec3d> points;
  points.reserve(static_cast<std::size_t>(array.shape(0)));
  for (const double* p = array.data(); p != array.data() + array.size(); p += 3) points.emplace_back(p[0], p[1], p[2]);
  return points;
}

py::array column_of(const std::vector<double>& values) { return numbers(values, {std::ssize(values)}); }

int corner_of(std::int64_t value, std::size_t patch) {
  constexpr std::int64_t kMost = std::numeric_limits<std::int32_t>::max();
  if (value < 0 || value > kMost) throw Error(fmt::format("boxes[{}]: a corner is {}; accepted: 0 to {}", patch, value, kMost));
  return static_cast<int>(value);
}

/// The patch's box; of two-dimensional data one cell deep.
Box box_of(const Corners& boxes, std::size_t patch) {
  const auto axes = static_cast<int>(boxes.shape(2));
  Box box{Vec3i(0), Vec3i(1)};
  const auto row = static_cast<py::ssize_t>(patch);
  for (int axis = 0; axis < axes; ++axis) {
    box.lower[axis] = corner_of(boxes.at(row, 0, axis), patch);
    box.upper[axis] = corner_of(boxes.at(row, 1, axis), patch);
  }
  return box;
}

Patch patch_of(const Corners& boxes, const py::sequence& values, std::size_t patch) {
  Patch result{box_of(boxes, patch), {}};
  for (const py::handle field : values) {
    const Cells cells = py::cast<Cells>(field[py::int_(patch)]);
    if (result.box.empty() || cells.size() != result.box.cells())
      throw Error(fmt::format("values[{0}]: {1} numbers, and boxes[{0}] has {2} cells", patch, cells.size(),
                              result.box.empty() ? 0 : result.box.cells()));
    result.values.push_back(std::vector<double>(cells.data(), cells.data() + cells.size()));
  }
  return result;
}

/// `values`: for each field, an array for each patch.
std::shared_ptr<Mesh> hierarchy(const std::string& name, const std::vector<std::string>& fields, std::vector<std::int64_t> levels,
                                const Corners& boxes, const py::sequence& values, std::vector<int> ratios,
                                std::array<double, 3> lower, std::array<double, 3> upper, std::array<int, 3> root_cells,
                                std::array<bool, 3> periodic) {
  if (boxes.ndim() != 3 || boxes.shape(0) != std::ssize(levels) || boxes.shape(1) != 2 || boxes.shape(2) < 2 ||
      boxes.shape(2) > 3)
    throw Error("boxes: accepted: an array of shape (patches, 2, 3), or (patches, 2, 2) for two-dimensional data");
  ArrayMesh arrays;
  MeshDescription& frame = arrays.frame;
  frame.name = name;
  frame.fields = fields;
  frame.ratios = std::move(ratios);
  frame.domain_lower = {lower[0], lower[1], lower[2]};
  frame.domain_upper = {upper[0], upper[1], upper[2]};
  frame.root_cells = {root_cells[0], root_cells[1], root_cells[2]};
  frame.periodic = periodic;
  frame.dimensions = static_cast<int>(boxes.shape(2));
  for (std::size_t patch = 0; patch < levels.size(); ++patch) arrays.patches.push_back(patch_of(boxes, values, patch));
  arrays.levels = std::move(levels);
  auto shared = std::make_shared<ArrayMesh>(std::move(arrays));
  return Session::instance().call<std::shared_ptr<Mesh>>(
      [shared] { return std::make_shared<Mesh>(make_hierarchy(std::move(*shared)), std::string()); });
}

std::string levels_text(const Mesh& held) {
  const AmrHierarchy& mesh = held.mesh();
  Json levels = Json::array();
  for (int l = 0; l < mesh.level_count(); ++l)
    levels.push_back({{"level", l},
                      {"patches", mesh.patches(l).size()},
                      {"cells", mesh.stored_cells(l)},
                      {"leaf_cells", mesh.leaf_cells(l)},
                      {"ratio_to_finer", mesh.ratio_to_finer(l)}});
  return text_of(levels);
}

py::dict statistics_of(const Mesh& held, const std::string& field) {
  const FieldStatistics& s = held.mesh().statistics(field.empty() ? 0 : held.mesh().field_index(field));
  py::dict result;
  result["min"] = s.min;
  result["max"] = s.max;
  result["volume_integral"] = s.volume_integral;
  result["cells_without_value"] = s.cells_without_value;
  return result;
}

std::array<double, 3> numbers_of(const Vec3d& v) { return {v.x, v.y, v.z}; }

std::shared_ptr<Mesh> open(const std::string& path, const std::vector<std::string>& fields) {
  return Session::instance().call<std::shared_ptr<Mesh>>(
      [path, fields] { return std::make_shared<Mesh>(AmrHierarchy(read_mesh(path, fields)), path); });
}

void save(const std::shared_ptr<Mesh>& mesh, const std::string& path, const std::string& format) {
  Session::instance().call<bool>([=] {
    write_mesh(mesh->mesh(), path, format);
    return true;
  });
}

/// What a GL context holds ends where it was made.
std::shared_ptr<HeldStructure> encode(const std::shared_ptr<Mesh>& mesh, StructureRequest request,
                                      const std::string& parameters) {
  request.parameters = Json::parse(parameters);
  return Session::instance().call<std::shared_ptr<HeldStructure>>([mesh, request] {
    auto made = std::make_unique<HeldStructure>(mesh, request, Session::instance().contexts());
    return std::shared_ptr<HeldStructure>(
        made.release(), [](HeldStructure* structure) { Session::instance().end([structure] { delete structure; }); });
  });
}

std::pair<py::array, std::vector<std::string>> drawn(const std::function<DrawnPicture()>& draw, bool as_double) {
  const DrawnPicture result = Session::instance().call<DrawnPicture>(draw);
  return {array_of(result.picture, as_double), result.warnings};
}

std::pair<py::array, std::vector<std::string>> render(const std::shared_ptr<Mesh>& mesh, const PictureRequest& request) {
  return drawn([=] { return draw_picture(plan_picture(*mesh, request), request, Session::instance().contexts()); },
               request.reference);
}

std::pair<py::array, std::vector<std::string>> render_scene(const PictureRequest& request) {
  return drawn([=] { return draw_picture(plan_scene(request), request, Session::instance().contexts()); }, request.reference);
}

std::pair<py::array, std::vector<std::string>> render_structure(const std::shared_ptr<HeldStructure>& structure,
                                                                const PictureRequest& request) {
  return drawn([=] { return structure->draw(request, Session::instance().contexts()); }, request.reference);
}

py::array sample(const std::shared_ptr<Mesh>& mesh, const Points& points, const std::string& field, const std::string& filter) {
  const FilterDefinition definition{.filter = parse_filter(filter), .page_level = mesh->mesh().finest_level()};
  return column_of(Session::instance().call<std::vector<double>>(
      [=, at = points_of(points)] { return sample_reference(*mesh, field, definition, at); }));
}

py::array sample_structure(const std::shared_ptr<HeldStructure>& structure, const Points& points, const std::string& column) {
  return column_of(
      Session::instance().call<std::vector<double>>([=, at = points_of(points)] { return structure->sample(at, column); }));
}

void write_picture(const Points& array, const std::string& path, std::array<double, 3> background, bool transparent) {
  const Picture picture = picture_of(array);
  const py::gil_scoped_release others_may_run;
  const std::string ending = std::filesystem::path(path).extension();
  if (ending == ".npy") return write_npy(picture, path, false);
  if (ending == ".exr") return write_exr(picture, path);
  if (ending != ".png")
    throw UsageError(
        fmt::format("{}: accepted: a name ending in .png (to look at), .exr or .npy (floats to measure)", clipped(path)));
  PngOptions options;
  options.background = background;
  options.transparent = transparent;
  write_png(picture, path, options);
}

std::string points_text(const RunRequest& request) {
  return Session::instance().call<std::string>([=] {
    Json points = Json::array();
    for (const ListedPoint& p : points_of(request))
      points.push_back({{"configuration", p.configuration}, {"status", p.status}, {"settings", p.settings}});
    return text_of(points);
  });
}

std::string run(const RunRequest& request, const std::optional<py::function>& recorded) {
  const auto run = std::make_shared<CancelableRun>(request);
  RunSummary summary;
  const auto tell = [&](const Json& record) {
    if (!recorded) return;
    const py::gil_scoped_acquire interpreter;
    (*recorded)(text_of(record));
  };
  Worker thread;  // the one that draws stays free
  const auto task = thread.start([&] { summary = run->run(tell); });
  Session::instance().wait(task, [run] { run->cancel(); });
  return text_of(to_json(summary));
}

std::pair<std::string, std::vector<std::string>> records(const std::string& folder) {
  const py::gil_scoped_release others_may_run;
  const RecordLines lines = load_record_lines(folder);
  return {text_of(Json(lines.records)), lines.warnings};
}

/// Python's types of our errors; they live as long as the module.
struct ErrorTypes {
  PyObject *error, *usage, *unsupported, *budget;
};

PyObject* make_error(py::module_& m, const char* name, PyObject* base, const char* text) {
  PyObject* const type = PyErr_NewExceptionWithDoc(fmt::format("amrtex.{}", name).c_str(), text, base, nullptr);
  if (type == nullptr) throw py::error_already_set();
  m.attr(name) = py::handle(type);
  return type;
}

/// As the command line prints it: a text that is no UTF-8 would be lost.
void tell(PyObject* type, const std::exception& error) { PyErr_SetString(type, printable(error.what()).c_str()); }

void add_errors(py::module_& m) {
  static ErrorTypes types;
  types.error =
      make_error(m, "Error", PyExc_Exception, "Bad input, or a failure of the GL context. The text is that of the command line.");
  types.usage =
      make_error(m, "UsageError", types.error, "A name, key or value that does not exist; the text says what is accepted.");
  types.unsupported = make_error(m, "UnsupportedError", types.error, "Something that this encoding or this context cannot do.");
  types.budget =
      make_error(m, "BudgetError", types.error, "More bytes than the memory limit allows, found before they were allocated.");
  py::register_exception_translator([](std::exception_ptr thrown) {
    try {
      if (thrown) std::rethrow_exception(thrown);
    } catch (const UsageError& e) {
      tell(types.usage, e);
    } catch (const UnsupportedError& e) {
      tell(types.unsupported, e);
    } catch (const BudgetError& e) {
      tell(types.budget, e);
    } catch (const Error& e) {
      tell(types.error, e);
    }
  });
}

void add_requests(py::module_& m) {
  py::class_<SceneArguments>(m, "SceneArguments")
      .def_readwrite("field", &SceneArguments::field)
      .def_readwrite("colormap", &SceneArguments::color_map)
      .def_readwrite("mode", &SceneArguments::mode)
      .def_readwrite("encoding", &SceneArguments::encoding)
      .def_readwrite("filter", &SceneArguments::filter)
      .def_readwrite("view", &SceneArguments::view)
      .def_readwrite("range", &SceneArguments::range)
      .def_readwrite("isovalue", &SceneArguments::isovalues)
      .def_readwrite("size", &SceneArguments::size)
      .def_readwrite("camera", &SceneArguments::camera)
      .def_readwrite("opacity_length", &SceneArguments::opacity_length)
      .def_readwrite("fovy", &SceneArguments::fov_y)
      .def_readwrite("log", &SceneArguments::logarithmic);
  py::class_<PictureRequest>(m, "PictureRequest")
      .def(py::init<>())
      .def_readwrite("arguments", &PictureRequest::arguments)
      .def_readwrite("scene", &PictureRequest::scene)
      .def_readwrite("scene_name", &PictureRequest::scene_name)
      .def_readwrite("set", &PictureRequest::set)
      .def_readwrite("context", &PictureRequest::context)
      .def_readwrite("memory_limit", &PictureRequest::memory_limit)
      .def_readwrite("tolerance", &PictureRequest::tolerance)
      .def_readwrite("prune", &PictureRequest::prune)
      .def_readwrite("reference", &PictureRequest::reference)
      .def_readwrite("reference_step", &PictureRequest::reference_step)
      .def_readwrite("reference_tolerance", &PictureRequest::reference_tolerance);
  py::class_<StructureRequest>(m, "StructureRequest")
      .def(py::init<>())
      .def_readwrite("field", &StructureRequest::field)
      .def_readwrite("encoding", &StructureRequest::encoding)
      .def_readwrite("filter", &StructureRequest::filter)
      .def_readwrite("storage", &StructureRequest::storage)
      .def_readwrite("filtering", &StructureRequest::filtering)
      .def_readwrite("context", &StructureRequest::context)
      .def_readwrite("memory_limit", &StructureRequest::memory_limit);
  py::class_<RunRequest>(m, "RunRequest")
      .def(py::init<>())
      .def_readwrite("text", &RunRequest::text)
      .def_readwrite("input", &RunRequest::input)
      .def_readwrite("out", &RunRequest::output)
      .def_readwrite("program", &RunRequest::program)
      .def_readwrite("where", &RunRequest::where)
      .def_readwrite("only", &RunRequest::only)
      .def_readwrite("set", &RunRequest::set)
      .def_property(
          "context", [](const RunRequest& r) { return r.context.context; },
          [](RunRequest& r, std::string name) { r.context.context = std::move(name); })
      .def_readwrite("memory_limit", &RunRequest::memory_limit)
      .def_readwrite("process_limit", &RunRequest::process_limit)
      .def_readwrite("time_limit", &RunRequest::time_limit)
      .def_readwrite("time_out", &RunRequest::time_out)
      .def_readwrite("repeat", &RunRequest::repeat)
      .def_readwrite("force", &RunRequest::force)
      .def_readwrite("keep_old", &RunRequest::keep_old)
      .def_readwrite("retry_failed", &RunRequest::retry_failed)
      .def_readwrite("no_pictures", &RunRequest::no_pictures);
}

void add_classes(py::module_& m) {
  py::class_<Mesh, std::shared_ptr<Mesh>>(m, "Mesh")
      .def_property_readonly("name", [](const Mesh& mesh) { return mesh.mesh().name(); })
      .def_property_readonly("fields", [](const Mesh& mesh) { return mesh.mesh().fields(); })
      .def_property_readonly("levels", &levels_text)
      .def_property_readonly("leaf_cells", [](const Mesh& mesh) { return mesh.mesh().leaf_cells(); })
      .def_property_readonly("lower", [](const Mesh& mesh) { return numbers_of(mesh.mesh().domain_lower()); })
      .def_property_readonly("upper", [](const Mesh& mesh) { return numbers_of(mesh.mesh().domain_upper()); })
      .def_property_readonly("hash", [](const Mesh& mesh) { return mesh.mesh().content_hash(0); })
      .def("statistics", &statistics_of)
      .def("save", &save)
      .def("encode", &encode)
      .def("sample", &sample)
      .def("render", &render);
  py::class_<HeldStructure, std::shared_ptr<HeldStructure>>(m, "Structure")
      .def_property_readonly("encoding", [](const HeldStructure& s) { return s.build().encoding; })
      .def_property_readonly("parameters", [](const HeldStructure& s) { return text_of(s.build().parameters); })
      .def_property_readonly("field", &HeldStructure::field)
      .def_property_readonly("filter", [](const HeldStructure& s) { return std::string(filter_name(s.build().filter)); })
      .def_property_readonly("storage", [](const HeldStructure& s) { return std::string(format_name(s.build().storage)); })
      .def_property_readonly("filtering", [](const HeldStructure& s) { return std::string(filtering_name(s.build().filtering)); })
      .def_property_readonly("build_seconds", &HeldStructure::build_seconds)
      .def_property_readonly("memory",
                             [](const HeldStructure& s) { return text_of(memory_json(s.encoded(), s.mesh().leaf_cells())); })
      .def("sample", &sample_structure)
      .def("render", &render_structure);
}

}  // namespace
}  // namespace amrtex

PYBIND11_MODULE(_core, m) {
  using namespace amrtex;
  m.doc() = "What the package amrtex is made of; see there.";
  add_errors(m);
  add_requests(m);
  add_classes(m);
  m.def("open", &open);
  m.def("hierarchy", &hierarchy);
  m.def("is_data_set", [](const std::string& path) { return is_data_set(path); });
  m.def("render_scene", &render_scene);
  m.def("write_picture", &write_picture);
  m.def("check_experiment", &check_experiment);
  m.def("points", &points_text);
  m.def("run", &run);
  m.def("records", &records);
  m.def("parse_bytes", &parse_bytes);
  m.def("encodings", [] {
    std::vector<std::string> names;
    for (const Encoding* encoding : all_encodings()) names.emplace_back(encoding->name());
    return names;
  });
  Py_AtExit([] { Session::instance().finish(); });
}
