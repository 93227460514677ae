#include "cli/u3m.h"

#include <algorithm>
#include <array>
#include <cmath>

#include <fmt/chrono.h>
#include <fmt/format.h>

#include "cli/textile_facts.h"
#include "core/file.h"
#include "render/png.h"

namespace weft::cli {

namespace {

using Json = nlohmann::json;

constexpr double kInchMm = 25.4;

// A UUID of version 4, variant 1, from the digest: equal databases are one material.
std::string uuid_of(const std::string& digest) {
  std::string hex = digest.substr(0, 32);
  hex.resize(32, '0');
  hex[12] = '4';
  hex[16] = "89ab"[(hex[16] <= '9' ? hex[16] - '0' : hex[16] - 'a' + 10) & 3];
  return hex.substr(0, 8) + "-" + hex.substr(8, 4) + "-" + hex.substr(12, 4) + "-" +
         hex.substr(16, 4) + "-" + hex.substr(20);
}

class U3mWriter {
 public:
  explicit U3mWriter(const MapSet& set) : set_(set), maps_(set.maps), means_(means_of(set.maps)) {}

  [[nodiscard]] Json whole(core::Clock::Time now) const {
    const std::string date =
        fmt::format("{:%Y-%m-%dT%H:%M:%S}Z", std::chrono::floor<std::chrono::seconds>(now));
    const Json material = {{"id", uuid_of(set_.content_digest)},
                           {"name", set_.name},
                           {"description", set_.description.comment()},
                           {"created", date},
                           {"modified", date},
                           {"front", front()},
                           {"back", nullptr},
                           {"side", nullptr},
                           {"physics", physics()},
                           {"metadata", nullptr}};
    const Json own = {{"content_digest", set_.content_digest}, {"maps", "maps.json"}};
    return {{"schema", "1.1"}, {"material", material}, {"custom", {{"weft", own}}}};
  }

 private:
  [[nodiscard]] Json image(const char* file) const {
    const auto dpi = [](std::uint32_t pixels, float mm) {
      return kInchMm * pixels / static_cast<double>(mm);
    };
    return {{"path", file},
            {"width", maps_.size_mm.x},
            {"height", maps_.size_mm.y},
            {"dpi",
             {{"x", dpi(maps_.width, maps_.size_mm.x)}, {"y", dpi(maps_.height, maps_.size_mm.y)}}},
            {"repeat", {{"rotation", 0}, {"mode", "normal"}}}};
  }

  [[nodiscard]] static Json constant(double value) {
    return {{"constant", value}, {"texture", nullptr}};
  }

  // A picture whose values become offset + factor value.
  [[nodiscard]] Json scalar(double mean, const char* file, double factor = 1,
                            double offset = 0) const {
    return {{"constant", mean},
            {"texture", {{"factor", factor}, {"offset", offset}, {"image", image(file)}}}};
  }

  [[nodiscard]] static Json colour(const glm::dvec3& c) {
    return {{"r", c.x}, {"g", c.y}, {"b", c.z}};
  }

  [[nodiscard]] Json front() const {
    const Json up = {{"x", 0}, {"y", 0}, {"z", 1}};
    const Json white = colour(glm::dvec3(1));
    const double f0 = std::clamp(
        static_cast<double>(glm::dot(maps_.reflection, glm::vec3(0.2126f, 0.7152f, 0.0722f))), 0.0,
        0.99);
    glm::dvec3 encoded;
    for (int c = 0; c < 3; ++c) {
      encoded[c] =
          static_cast<double>(render::srgb_encoded(static_cast<float>(means_.base_colour[c])));
    }
    const double low = static_cast<double>(maps_.z_bounds_mm.x);
    const double high = static_cast<double>(maps_.z_bounds_mm.y);
    Json front;
    front["shader"] = "principled";
    front["preview"] = nullptr;
    front["alpha"] = scalar(means_.coverage, "alpha.png");
    front["basecolor"] = {
        {"constant", colour(encoded)},
        {"texture", {{"mode", "multiply"}, {"factor", white}, {"image", image("base_color.png")}}}};
    front["normal"] = {{"constant", up},
                       {"texture", {{"scale", 1}, {"image", image("normal.png")}}}};
    front["displacement"] = scalar(0, "height.png", high - low, low);
    front["roughness"] = scalar(means_.roughness, "roughness.png");
    front["anisotropy_value"] = scalar(means_.anisotropy, "anisotropy_strength.png");
    front["anisotropy_rotation"] =
        scalar(means_.rotation, "anisotropy_rotation.png", 0.5, kLeastRotation);
    front["transmission"] = scalar(means_.transmission, "transmission.png");
    front["metalness"] = constant(0);
    front["ior"] = constant((1 + std::sqrt(f0)) / (1 - std::sqrt(f0)));
    front["specular_value"] = constant(std::min(1.0, f0 / 0.08));  // 1 stands for 8 %
    front["specular_tint"] = constant(0);
    front["sheen_value"] = constant(static_cast<double>(
        std::max({maps_.sheen_colour.x, maps_.sheen_colour.y, maps_.sheen_colour.z})));
    front["sheen_tint"] = constant(0);
    front["clearcoat_value"] = constant(0);
    front["clearcoat_roughness"] = constant(0);
    front["clearcoat_normal"] = {{"constant", up}, {"texture", nullptr}};
    front["subsurface_value"] = constant(0);
    front["subsurface_radius"] = constant(0);
    front["subsurface_color"] = {{"constant", white}, {"texture", nullptr}};
    return front;
  }

  [[nodiscard]] static Json word(const TradeWord& word) {
    return {{"type", word.type}, {"name", word.name.empty() ? Json(nullptr) : Json(word.name)}};
  }

  [[nodiscard]] Json physics() const {
    Json parts = Json::array();
    for (const Fibre& fibre : composition(*set_.tile)) {
      Json part = word(fibre.word);
      part["ratio"] = fibre.share;
      parts.push_back(part);
    }
    Json physics;
    physics["thickness"] = maps_.z_bounds_mm.y - maps_.z_bounds_mm.x;
    physics["weight"] = nullptr;
    physics["devices"] = {{"fab", "null"}};
    physics["composition"] = {{"parts", parts}};
    physics["material_type"] = word(material_type(set_.description));
    physics["construction"] = word(construction(set_.description));
    return physics;
  }

  const MapSet& set_;
  const render::MaterialMaps& maps_;
  MapMeans means_;
};

}  // namespace

void write_u3m(const MapSet& set, const std::filesystem::path& folder, core::Clock::Time now) {
  core::write_file_atomically(folder / (set.name + ".u3m"),
                              U3mWriter(set).whole(now).dump(2) + "\n");
}

}  // namespace weft::cli
