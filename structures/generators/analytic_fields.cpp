#include "structures/generators/analytic_fields.hpp"

#include <fmt/format.h>
#include <fmt/ranges.h>

#include <array>
#include <cmath>
#include <numbers>
#include <random>
#include <utility>
#include <vector>

#include "structures/mesh/error.hpp"
#include "structures/mesh/quoted.hpp"

namespace amrtex {

namespace {

using FieldPointer = std::unique_ptr<AnalyticField>;

class TrilinearField final : public AnalyticField {
 public:
  /// Coefficients of 1, x, y, z, xy, xz, yz, xyz.
  explicit TrilinearField(std::vector<double> coefficients) : c_(std::move(coefficients)) {}

  double value(const Vec3d& p) const override {
    return c_[0] + c_[1] * p.x + c_[2] * p.y + c_[3] * p.z + c_[4] * p.x * p.y + c_[5] * p.x * p.z + c_[6] * p.y * p.z +
           c_[7] * p.x * p.y * p.z;
  }
  Vec3d gradient(const Vec3d& p) const override {
    return {c_[1] + c_[4] * p.y + c_[5] * p.z + c_[7] * p.y * p.z, c_[2] + c_[4] * p.x + c_[6] * p.z + c_[7] * p.x * p.z,
            c_[3] + c_[5] * p.x + c_[6] * p.y + c_[7] * p.x * p.y};
  }

 private:
  std::vector<double> c_;
};

double nearest(const WorldBox& box, const Vec3d& p) { return glm::distance(glm::clamp(p, box.lower, box.upper), p); }
double farthest(const WorldBox& box, const Vec3d& p) {
  return glm::length(glm::max(glm::abs(box.lower - p), glm::abs(box.upper - p)));
}

/// Largest of q exp(-q^2 / 2) for q from `from` to `to`, both 0 or more: it rises up to 1 and falls beyond.
double steepest(double from, double to) {
  const double q = std::clamp(1.0, from, to);
  return q * std::exp(-q * q / 2);
}

struct Blob {
  Vec3d center;      ///< world
  double sigma;      ///< standard deviation, world length
  double amplitude;  ///< field units
};

class BlobsField final : public AnalyticField {
 public:
  explicit BlobsField(std::vector<Blob> blobs) : blobs_(std::move(blobs)) {}

  double value(const Vec3d& p) const override {
    double sum = 0;
    for (const Blob& b : blobs_) sum += term(b, p - b.center);
    return sum;
  }
  Vec3d gradient(const Vec3d& p) const override {
    Vec3d sum(0);
    for (const Blob& b : blobs_) sum -= term(b, p - b.center) / (b.sigma * b.sigma) * (p - b.center);
    return sum;
  }
  double steepest_in(const WorldBox& box) const override {
    double sum = 0;
    for (const Blob& b : blobs_)
      sum += std::abs(b.amplitude) / b.sigma * steepest(nearest(box, b.center) / b.sigma, farthest(box, b.center) / b.sigma);
    return sum;
  }

 private:
  static double term(const Blob& b, const Vec3d& d) {
    return b.amplitude * std::exp(-(d.x * d.x + d.y * d.y + d.z * d.z) / (2 * b.sigma * b.sigma));
  }

  std::vector<Blob> blobs_;
};

struct Shell {
  Vec3d center;      ///< world
  double radius;     ///< world length
  double width;      ///< standard deviation across the shell, world length
  double amplitude;  ///< field units
  int lobes;         ///< bright patches round the z axis; 0 = the same brightness everywhere
};

class ShellField final : public AnalyticField {
 public:
  explicit ShellField(const Shell& shell) : s_(shell) {}

  double value(const Vec3d& p) const override {
    const Vec3d d = p - s_.center;
    const double r = length(d);
    if (vanishes(r)) return 0;
    return s_.amplitude * brightness(d, r) * profile(r);
  }
  Vec3d gradient(const Vec3d& p) const override {
    const Vec3d d = p - s_.center;
    const double r = length(d);
    if (vanishes(r) || r == 0) return Vec3d(0);
    const double slope = -(r - s_.radius) / (s_.width * s_.width);
    return s_.amplitude * profile(r) * (brightness_gradient(d, r) + brightness(d, r) * slope / r * d);
  }
  double steepest_in(const WorldBox& box) const override {
    const double low = nearest(box, s_.center), high = farthest(box, s_.center);
    const double from =
        low <= s_.radius && s_.radius <= high ? 0 : std::min(std::abs(low - s_.radius), std::abs(high - s_.radius)) / s_.width;
    const double to = std::max(std::abs(low - s_.radius), std::abs(high - s_.radius)) / s_.width;
    // around the axis the brightness changes by at most lobes / r, towards it by 1 / r; half of both
    const double brightest = std::exp(-from * from / 2);
    const double across = s_.lobes == 0 || brightest == 0 ? 0 : 0.5 * (s_.lobes + 1) / low * brightest;
    return std::abs(s_.amplitude) * (steepest(from, to) / s_.width + across);
  }

 private:
  static double length(const Vec3d& d) { return std::sqrt(d.x * d.x + d.y * d.y + d.z * d.z); }
  double profile(double r) const {
    const double q = (r - s_.radius) / s_.width;
    return std::exp(-(q * q) / 2);
  }
  // exp of anything below -745.2 is exactly 0: most of the domain needs no angle.
  bool vanishes(double r) const {
    const double q = (r - s_.radius) / s_.width;
    return q * q > 2 * 750.0;
  }
  /// 1/2 + 1/2 cos(lobes * azimuth) sin^2(polar angle)
  double brightness(const Vec3d& d, double r) const {
    if (s_.lobes == 0) return 1;
    const double cosine = r > 0 ? d.z / r : 0;
    return 0.5 + 0.5 * std::cos(s_.lobes * std::atan2(d.y, d.x)) * (1 - cosine * cosine);
  }
  Vec3d brightness_gradient(const Vec3d& d, double r) const {
    const double rho2 = d.x * d.x + d.y * d.y;
    if (s_.lobes == 0 || rho2 == 0) return Vec3d(0);  // on the axis sin^2 has a double zero
    const double angle = s_.lobes * std::atan2(d.y, d.x);
    const double r2 = r * r;
    const Vec3d azimuth = -s_.lobes * std::sin(angle) / r2 * Vec3d(-d.y, d.x, 0);
    const Vec3d polar = std::cos(angle) * (2 * d.z * d.z / (r2 * r2) * d - Vec3d(0, 0, 2 * d.z / r2));
    return 0.5 * (azimuth + polar);
  }

  Shell s_;
};

class StepField final : public AnalyticField {
 public:
  StepField(const Vec3d& normal, double offset, double low, double high)
      : normal_(normal), offset_(offset), low_(low), high_(high) {}

  double value(const Vec3d& p) const override { return glm::dot(normal_, p) < offset_ ? low_ : high_; }
  Vec3d gradient(const Vec3d&) const override { return Vec3d(0); }

 private:
  Vec3d normal_;
  double offset_, low_, high_;
};

class OscillatingField final : public AnalyticField {
 public:
  /// `wave_number` in periods a world length.
  OscillatingField(const Vec3d& wave_number, double amplitude, const Vec3d& origin)
      : k_(2 * std::numbers::pi * wave_number), amplitude_(amplitude), origin_(origin) {}

  double value(const Vec3d& p) const override {
    double product = amplitude_;
    for (int a = 0; a < 3; ++a) product *= factor(a, p);
    return product;
  }
  Vec3d gradient(const Vec3d& p) const override {
    Vec3d g(amplitude_);
    for (int a = 0; a < 3; ++a)
      for (int b = 0; b < 3; ++b) g[a] *= a == b ? k_[a] * std::cos(phase(a, p)) : factor(b, p);
    return g;
  }

 private:
  double phase(int axis, const Vec3d& p) const { return k_[axis] * (p[axis] - origin_[axis]); }
  double factor(int axis, const Vec3d& p) const { return k_[axis] == 0 ? 1 : std::sin(phase(axis, p)); }

  Vec3d k_;
  double amplitude_;
  Vec3d origin_;
};

class SumField final : public AnalyticField {
 public:
  explicit SumField(std::vector<FieldPointer> terms) : terms_(std::move(terms)) {}

  double value(const Vec3d& p) const override {
    double sum = 0;
    for (const FieldPointer& term : terms_) sum += term->value(p);
    return sum;
  }
  Vec3d gradient(const Vec3d& p) const override {
    Vec3d sum(0);
    for (const FieldPointer& term : terms_) sum += term->gradient(p);
    return sum;
  }
  double steepest_in(const WorldBox& box) const override {
    double sum = 0;
    for (const FieldPointer& term : terms_) sum += term->steepest_in(box);
    return sum;
  }

 private:
  std::vector<FieldPointer> terms_;
};

FieldPointer read_field(const Json& field, const std::string& path, const WorldBox& domain);

FieldPointer read_constant(SpecReader& reader, const WorldBox&) {
  return std::make_unique<TrilinearField>(std::vector<double>{reader.number("value", 1), 0, 0, 0, 0, 0, 0, 0});
}

FieldPointer read_linear(SpecReader& reader, const WorldBox&) {
  const double value = reader.number("value", 0);
  const Vec3d g = reader.vector("gradient", Vec3d(1, 0, 0));
  return std::make_unique<TrilinearField>(std::vector<double>{value, g.x, g.y, g.z, 0, 0, 0, 0});
}

FieldPointer read_trilinear(SpecReader& reader, const WorldBox&) {
  return std::make_unique<TrilinearField>(reader.numbers("coefficients", {0, 1, 1, 1, 1, 1, 1, 1}, 8));
}

/// Uniform in [0, 1) with 53 bits, the numbers of numpy.random.RandomState(seed).random_sample().
double next_random(std::mt19937& generator) {
  const auto high = static_cast<double>(generator() >> 5);
  const auto low = static_cast<double>(generator() >> 6);
  return (high * 67108864.0 + low) / 9007199254740992.0;
}

FieldPointer read_blobs(SpecReader& reader, const WorldBox& domain) {
  const std::int64_t count = reader.integer("count", 7, 1, 10000);
  std::mt19937 generator(static_cast<std::uint32_t>(reader.integer("seed", 7, 0, UINT32_MAX)));
  const auto uniform = [&](double low, double high) { return low + (high - low) * next_random(generator); };
  std::vector<Blob> blobs(static_cast<std::size_t>(count));
  for (Blob& blob : blobs) {
    Vec3d fraction;
    for (int a = 0; a < 3; ++a) fraction[a] = uniform(0.22, 0.78);
    blob.center = domain.at(fraction);
    blob.sigma = uniform(0.03, 0.09) * domain.edge();
    blob.amplitude = uniform(0.5, 1.0);
  }
  return std::make_unique<BlobsField>(std::move(blobs));
}

FieldPointer read_shell_with(SpecReader& reader, const WorldBox& domain, int default_lobes) {
  Shell shell{};
  shell.center = reader.vector("center", domain.middle());
  shell.radius = reader.number("radius", 0.22 * domain.edge(), "a number above 0", is_positive);
  shell.width = reader.number("width", 0.006 * domain.edge(), "a number above 0", is_positive);
  shell.amplitude = reader.number("amplitude", 0.9);
  shell.lobes = static_cast<int>(reader.integer("lobes", default_lobes, 0, 1000));
  return std::make_unique<ShellField>(shell);
}

FieldPointer read_shell(SpecReader& reader, const WorldBox& domain) { return read_shell_with(reader, domain, 0); }

FieldPointer read_blobs_shell(SpecReader& reader, const WorldBox& domain) {
  std::vector<FieldPointer> terms;
  terms.push_back(read_blobs(reader, domain));
  terms.push_back(read_shell_with(reader, domain, 3));
  return std::make_unique<SumField>(std::move(terms));
}

FieldPointer read_step(SpecReader& reader, const WorldBox& domain) {
  const Vec3d normal = reader.vector("normal", Vec3d(1, 0, 0));
  const double length = glm::length(normal);
  if (!(length > 0)) reader.refuse("normal", "three numbers that are not all 0");
  const double offset = reader.number("offset", glm::dot(normal / length, domain.middle()));
  return std::make_unique<StepField>(normal / length, offset, reader.number("low", 0), reader.number("high", 1));
}

FieldPointer read_oscillating(SpecReader& reader, const WorldBox& domain) {
  const Vec3d wave_number = reader.vector("wave_number", Vec3d(2) / domain.extent());
  return std::make_unique<OscillatingField>(wave_number, reader.number("amplitude", 1), domain.lower);
}

FieldPointer read_sum(SpecReader& reader, const WorldBox& domain) {
  const Json* list = reader.find("terms");
  if (list == nullptr || !list->is_array() || list->empty()) reader.refuse("terms", "a list of at least one field");
  std::vector<FieldPointer> terms;
  for (std::size_t i = 0; i < list->size(); ++i)
    terms.push_back(read_field((*list)[i], fmt::format("{}[{}]", reader.path_of("terms"), i), domain));
  return std::make_unique<SumField>(std::move(terms));
}

struct FieldType {
  std::string_view name;
  FieldPointer (*read)(SpecReader&, const WorldBox&);
};

constexpr std::array<FieldType, 9> kFieldTypes{{{"constant", read_constant},
                                                {"linear", read_linear},
                                                {"trilinear", read_trilinear},
                                                {"blobs", read_blobs},
                                                {"shell", read_shell},
                                                {"blobs_shell", read_blobs_shell},
                                                {"step", read_step},
                                                {"oscillating", read_oscillating},
                                                {"sum", read_sum}}};

[[noreturn]] void refuse_type(const std::string& path, const Json& value) {
  std::vector<std::string_view> names;
  for (const FieldType& type : kFieldTypes) names.push_back(type.name);
  throw UsageError(fmt::format("generator key \"{}\": {} is not accepted; accepted: one of {}, or an object with such a \"type\"",
                               path, shown(value), fmt::join(names, ", ")));
}

const FieldType& find_type(const std::string& path, const Json& value) {
  if (!value.is_string()) refuse_type(path, value);
  const auto name = value.get<std::string>();
  for (const FieldType& type : kFieldTypes)
    if (type.name == name) return type;
  refuse_type(path, value);
}

/// A field is written as its type alone or as an object that holds the type and its keys.
FieldPointer read_field(const Json& field, const std::string& path, const WorldBox& domain) {
  if (!field.is_string() && !field.is_object()) refuse_type(path, field);
  const Json object = field.is_string() ? Json{{"type", field}} : field;
  SpecReader reader(object, path);
  const Json* type = reader.find("type");
  FieldPointer result =
      find_type(field.is_string() ? path : reader.path_of("type"), type == nullptr ? Json() : *type).read(reader, domain);
  reader.finish();
  return result;
}

Json field_of(const Json& specification) {
  SpecReader reader(specification, "");
  const Json* field = reader.find("field");
  return field == nullptr ? Json("blobs_shell") : *field;
}

}  // namespace

WorldBox read_domain(SpecReader& specification) {
  WorldBox box;
  const Json* domain = specification.find("domain");
  if (domain == nullptr) return box;
  SpecReader reader(*domain, specification.path_of("domain"));
  box.lower = reader.vector("lower", box.lower);
  box.upper = reader.vector("upper", box.upper);
  reader.finish();
  const Vec3d extent = box.extent();
  for (int a = 0; a < 3; ++a)
    if (!(extent[a] > 0) || !std::isfinite(extent[a]))
      specification.refuse("domain", "an upper corner above the lower one on every axis");
  return box;
}

std::string analytic_field_type(const Json& specification) {
  const Json field = field_of(specification);
  if (field.is_string()) return field.get<std::string>();
  const Json* type = SpecReader(field, "field").find("type");
  return type != nullptr && type->is_string() ? type->get<std::string>() : std::string();
}

std::unique_ptr<AnalyticField> make_analytic_field(const Json& specification) {
  SpecReader reader(specification, "");
  const WorldBox domain = read_domain(reader);
  return read_field(field_of(specification), "field", domain);
}

}  // namespace amrtex
