#include "fabric/export_curves.h"

#include <algorithm>
#include <array>
#include <cstdio>
#include <cstring>
#include <limits>

#include <glm/common.hpp>

#include "core/check.h"
#include "core/error.h"

namespace weft::fabric {

namespace {

// Binary curve collection, as its author's page lays it out; little-endian like all our machines.
struct BccHeader {
  std::array<char, 3> sign{'B', 'C', 'C'};
  std::uint8_t byte_count = 0x44;  // integers and floats of four bytes
  std::array<char, 2> curve_type{'C', '0'};
  std::uint8_t dimensions = 3;
  std::uint8_t up_dimension = 2;
  std::uint64_t curve_count = 0;
  std::uint64_t point_count = 0;
  std::array<char, 40> info{"weft: fibres of cloth, millimetres"};
};
static_assert(sizeof(BccHeader) == 64);

template <class T>
void append_bytes(std::string& out, const T& value) {
  std::array<char, sizeof(T)> bytes{};
  std::memcpy(bytes.data(), &value, sizeof(T));
  out.append(bytes.data(), bytes.size());
}

// Nine digits give back every float exactly.
void append_point(std::string& out, glm::vec3 p) {
  std::array<char, 64> text{};
  const int length =
      std::snprintf(text.data(), text.size(), "%.9g %.9g %.9g", static_cast<double>(p.x),
                    static_cast<double>(p.y), static_cast<double>(p.z));
  out.append(text.data(), static_cast<std::size_t>(length));
}

std::string number(float value) {
  std::array<char, 32> text{};
  std::snprintf(text.data(), text.size(), "%.9g", static_cast<double>(value));
  return text.data();
}

// Calls visit(strand, shift) for every strand, copied over the tiles row by row.
template <class Visit>
void for_each_curve(const Tile& tile, glm::uvec2 tiles, const Visit& visit) {
  for (const Strand& strand : tile.strands) {
    for (std::uint32_t j = 0; j < tiles.y; ++j) {
      for (std::uint32_t i = 0; i < tiles.x; ++i) {
        visit(strand, glm::vec3(static_cast<float>(i) * tile.size_mm.x,
                                static_cast<float>(j) * tile.size_mm.y, 0));
      }
    }
  }
}

std::string header_comment(const Tile& tile, glm::uvec2 tiles) {
  return "# Fibres of woven or knitted cloth, written by weft. Lengths are millimetres.\n"
         "# One tile is " +
         number(tile.size_mm.x) + " x " + number(tile.size_mm.y) + " mm; this is " +
         std::to_string(tiles.x) + " x " + std::to_string(tiles.y) + " tiles.\n";
}

std::string export_bcc(const Tile& tile, glm::uvec2 tiles) {
  BccHeader header;
  const std::uint64_t copies = std::uint64_t{tiles.x} * tiles.y;
  header.curve_count = tile.strands.size() * copies;
  header.point_count = tile.points_mm.size() * copies;
  std::string out;
  out.reserve(sizeof(header) + 4 * header.curve_count + 12 * header.point_count);
  append_bytes(out, header);
  for_each_curve(tile, tiles, [&](const Strand& strand, glm::vec3 shift) {
    append_bytes(out, static_cast<std::int32_t>(strand.point_count));
    for (std::uint32_t p = 0; p < strand.point_count; ++p) {
      append_bytes(out, tile.points_mm[strand.first_point + p] + shift);
    }
  });
  return out;
}

std::string export_obj(const Tile& tile, glm::uvec2 tiles) {
  std::string out = header_comment(tile, tiles);
  std::uint64_t next_vertex = 1;
  std::uint32_t thread = ~0U;
  for_each_curve(tile, tiles, [&](const Strand& strand, glm::vec3 shift) {
    if (strand.thread != thread) {
      thread = strand.thread;
      out += "g thread_" + std::to_string(thread) + "_" +
             tile.yarn_names[tile.threads[thread].yarn] + "\n";
    }
    out += "# radius " + number(strand.radius_mm) + "\n";
    for (std::uint32_t p = 0; p < strand.point_count; ++p) {
      out += "v ";
      append_point(out, tile.points_mm[strand.first_point + p] + shift);
      out += "\n";
    }
    // One line for each segment: of longer ones, Blender 3.4 takes the first two points alone.
    for (std::uint32_t p = 0; p + 1 < strand.point_count; ++p) {
      out.append("l ").append(std::to_string(next_vertex + p));
      out.append(" ").append(std::to_string(next_vertex + p + 1)).append("\n");
    }
    next_vertex += strand.point_count;
  });
  return out;
}

std::string pbrt_materials(const Tile& tile, const std::vector<glm::vec3>& albedos) {
  std::string out;
  for (std::size_t m = 0; m < tile.material_names.size(); ++m) {
    const glm::vec3 albedo = m < albedos.size() ? albedos[m] : glm::vec3(0.5F);
    out += "MakeNamedMaterial \"" + tile.material_names[m] +
           "\" \"string type\" \"diffuse\" \"rgb reflectance\" [ ";
    append_point(out, glm::clamp(albedo, glm::vec3(0), glm::vec3(1)));
    out += " ]\n";
  }
  return out;
}

std::string export_pbrt(const Tile& tile, const ExportOptions& options) {
  std::string out = header_comment(tile, options.tiles);
  out += "# Put your own materials in place of these; geometry is for an Include in a scene.\n";
  out += pbrt_materials(tile, options.albedos);
  std::uint32_t material = ~0U;
  for_each_curve(tile, options.tiles, [&](const Strand& strand, glm::vec3 shift) {
    if (strand.material != material) {
      material = strand.material;
      out += "NamedMaterial \"" + tile.material_names[material] + "\"\n";
    }
    const std::string width = number(2 * strand.radius_mm);
    out += "Shape \"curve\" \"string type\" \"cylinder\" \"float width0\" " + width +
           " \"float width1\" " + width + " \"point3 P\" [\n";
    const glm::vec3* points = tile.points_mm.data() + strand.first_point;
    append_point(out, points[0] + shift);
    for (std::uint32_t p = 0; p + 1 < strand.point_count; ++p) {
      const glm::vec3 a = points[p] + shift;
      const glm::vec3 b = points[p + 1] + shift;
      for (const glm::vec3& control : {a + (b - a) / 3.0F, b - (b - a) / 3.0F, b}) {
        out += "\n";
        append_point(out, control);
      }
    }
    out += " ]\n";
  });
  return out;
}

// What `append` adds, between brackets and with commas.
template <class Append>
void append_list(std::string& out, const char* declaration, const Append& append) {
  out += std::string("        ") + declaration + " = [";
  bool first = true;
  append([&](const std::string& item) {
    out.append(first ? "" : ", ").append(item);
    first = false;
  });
  out += "]";
}

std::string tuple(glm::vec3 p) {
  std::string text = "(";
  text.append(number(p.x)).append(", ").append(number(p.y)).append(", ").append(number(p.z));
  return text.append(")");
}

// A name as USD takes it: letters, digits and underscores, no digit first.
std::string usd_name(std::size_t index, const std::string& name) {
  std::string result = "material_" + std::to_string(index) + "_";
  for (const char c : name) {
    const bool plain = (c >= 'a' && c <= 'z') || (c >= 'A' && c <= 'Z') || (c >= '0' && c <= '9');
    result += plain ? c : '_';
  }
  return result;
}

// The fibres of one material as one prim.
void append_usd_curves(std::string& out, const Tile& tile, const ExportOptions& options,
                       std::uint32_t material) {
  const auto for_each = [&](const auto& visit) {
    for_each_curve(tile, options.tiles, [&](const Strand& strand, glm::vec3 shift) {
      if (strand.material == material) {
        visit(strand, shift);
      }
    });
  };
  glm::vec3 low(std::numeric_limits<float>::max());
  glm::vec3 high(std::numeric_limits<float>::lowest());
  out += "    def BasisCurves \"" + usd_name(material, tile.material_names[material]) +
         "\"\n    {\n        uniform token type = \"linear\"\n"
         "        uniform token wrap = \"nonperiodic\"\n";
  append_list(out, "int[] curveVertexCounts", [&](const auto& add) {
    for_each([&](const Strand& strand, glm::vec3) { add(std::to_string(strand.point_count)); });
  });
  out += "\n";
  append_list(out, "point3f[] points", [&](const auto& add) {
    for_each([&](const Strand& strand, glm::vec3 shift) {
      for (std::uint32_t p = 0; p < strand.point_count; ++p) {
        const glm::vec3 point = tile.points_mm[strand.first_point + p] + shift;
        low = glm::min(low, point - strand.radius_mm);
        high = glm::max(high, point + strand.radius_mm);
        add(tuple(point));
      }
    });
  });
  out += "\n";
  append_list(out, "float[] widths", [&](const auto& add) {
    for_each([&](const Strand& strand, glm::vec3) { add(number(2 * strand.radius_mm)); });
  });
  const glm::vec3 colour =
      material < options.albedos.size() ? options.albedos[material] : glm::vec3(0.5F);
  out += " (\n            interpolation = \"uniform\"\n        )\n        float3[] extent = [" +
         tuple(low) + ", " + tuple(high) + "]\n        color3f[] primvars:displayColor = [" +
         tuple(glm::clamp(colour, glm::vec3(0), glm::vec3(1))) + "]\n    }\n";
}

std::string export_usda(const Tile& tile, const ExportOptions& options) {
  std::string out =
      "#usda 1.0\n(\n    defaultPrim = \"Fibres\"\n    doc = \"Fibres of woven or knitted cloth, "
      "written by weft. One tile is " +
      number(tile.size_mm.x) + " x " + number(tile.size_mm.y) + " mm; this is " +
      std::to_string(options.tiles.x) + " x " + std::to_string(options.tiles.y) +
      " tiles.\"\n    metersPerUnit = 0.001\n    upAxis = \"Z\"\n)\n\ndef Xform \"Fibres\"\n{\n";
  std::vector<bool> is_used(tile.material_names.size());
  for (const Strand& strand : tile.strands) {
    is_used[strand.material] = true;
  }
  for (std::uint32_t material = 0; material < is_used.size(); ++material) {
    if (is_used[material]) {
      append_usd_curves(out, tile, options, material);
    }
  }
  return out + "}\n";
}

}  // namespace

std::string export_curves(const Tile& tile, const ExportOptions& options) {
  if (options.tiles.x == 0 || options.tiles.y == 0) {
    throw core::Error(core::Code::kInvalidArgument, "nothing to export: give at least 1 x 1 tiles");
  }
  const std::uint64_t per_point = options.format == CurveFormat::kPbrt ? 3 : 1;
  const auto points =
      static_cast<double>(per_point * tile.points_mm.size()) * options.tiles.x * options.tiles.y;
  if (points > static_cast<double>(kExportPointLimit)) {
    std::array<char, 200> text{};
    std::snprintf(text.data(), text.size(),
                  "the export would have %.3g control points, more than the limit of %.3g; export "
                  "fewer tiles",
                  points, static_cast<double>(kExportPointLimit));
    throw core::Error(core::Code::kResourceExhausted, text.data());
  }
  switch (options.format) {
    case CurveFormat::kPbrt:
      return export_pbrt(tile, options);
    case CurveFormat::kBcc:
      return export_bcc(tile, options.tiles);
    case CurveFormat::kObj:
      return export_obj(tile, options.tiles);
    case CurveFormat::kUsda:
      return export_usda(tile, options);
  }
  CHECK(false);
}

}  // namespace weft::fabric
