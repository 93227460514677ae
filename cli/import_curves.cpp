#include "cli/import_curves.h"

#include <charconv>
#include <cstdio>
#include <filesystem>

#include <CLI/CLI.hpp>
#include <fmt/format.h>
#include <google/protobuf/text_format.h>

#include "cli/output_file.h"
#include "cli/print_json.h"
#include "core/check.h"
#include "core/error.h"
#include "core/file.h"
#include "fabric/bcc.h"
#include "fabric/description.h"
#include "fabric/description_check.h"
#include "fabric/wif_import.h"

namespace weft::cli {

namespace {

[[noreturn]] void refuse(const std::string& what) {
  throw core::Error(core::Code::kInvalidArgument, what);
}

glm::dvec2 parse_period(const std::string& text) {
  if (text.empty()) {
    throw CLI::ValidationError(
        "--period", "curves do not say where they repeat; give it as X,Y, in millimetres");
  }
  glm::dvec2 period(0);
  const std::size_t comma = std::min(text.find(','), text.size());
  const auto number = [&](std::size_t from, std::size_t to, double& value) {
    const auto [end, error] = std::from_chars(text.data() + from, text.data() + to, value);
    return error == std::errc() && end == text.data() + to && value > 0 && value < 1e6;
  };
  if (comma >= text.size() || !number(0, comma, period.x) ||
      !number(comma + 1, text.size(), period.y)) {
    throw CLI::ValidationError("--period", text + " is not two lengths; write for example 4.2,3.5");
  }
  return period;
}

v1::FabricDescription described(const CurveImport& wanted, const std::string& name,
                                const std::vector<fabric::BccCurve>& curves,
                                const fabric::CurveTiling& tiling) {
  v1::FabricDescription description;
  description.set_name(name);
  const std::string material = "fibre";
  v1::Material& fibre = *description.add_materials();
  fibre.set_name(material);
  fibre.set_preset("cotton");
  if (wanted.as == "fibres") {
    *description.mutable_explicit_fibres() = fabric::explicit_fibres(curves, tiling, material);
    return description;
  }
  v1::YarnCurves& yarns = *description.mutable_yarn_curves();
  yarns.set_pyp_text(fabric::pattern_text(curves, tiling, wanted.curves));
  yarns.set_scale(1);
  yarns.set_yarn("yarn");
  v1::Yarn& yarn = *description.add_yarns();
  yarn.set_name("yarn");
  yarn.set_material(material);
  yarn.set_yarn_radius_mm(tiling.radius_mm);
  return description;
}

std::string text_of(const v1::FabricDescription& description) {
  std::string text;
  CHECK(google::protobuf::TextFormat::PrintToString(description, &text));
  return text;
}

// A pattern is a person's to edit: it stands beside the description.
void write_pattern(const std::filesystem::path& out, v1::YarnCurves& yarns) {
  const std::filesystem::path pattern = std::filesystem::path(out).replace_extension(".pyp");
  if (std::filesystem::exists(pattern)) {
    throw core::Error(core::Code::kAlreadyExists,
                      pattern.string() +
                          " exists already, and the yarns' pattern would be written there; "
                          "choose another -o");
  }
  core::write_file_atomically(pattern, yarns.pyp_text());
  yarns.set_pyp_file(pattern.filename().string());
}

}  // namespace

bool holds_curves(const std::string& name) {
  const std::string extension = std::filesystem::path(name).extension().string();
  return extension == ".bcc" || extension == ".BCC";
}

void import_curves(const CurveImport& wanted) {
  check_output_file(wanted.out);
  fabric::CurveTiling tiling;
  tiling.period_mm = parse_period(wanted.period);
  tiling.mm_per_unit = wanted.mm_per_unit;
  tiling.radius_mm = wanted.radius_mm;
  const std::string name =
      wanted.name.empty()
          ? fabric::name_from_file(std::filesystem::path(wanted.curves).stem().string())
          : wanted.name;
  if (!fabric::is_name(name)) {
    refuse("--name " + name + " is no name; use small letters, digits, _ and -, at most 64");
  }
  const std::vector<fabric::BccCurve> curves =
      fabric::read_bcc(core::read_file(wanted.curves, fabric::kMostBccBytes), wanted.curves);
  v1::FabricDescription description = described(wanted, name, curves, tiling);
  // What is wrong with the cloth is said now, before anything is written.
  static_cast<void>(fabric::parse_description(text_of(description), wanted.curves, "."));
  if (description.has_yarn_curves()) {
    write_pattern(wanted.out, *description.mutable_yarn_curves());
  }
  core::write_file_atomically(
      wanted.out,
      "# Made by weft import from curves; proto/weft/v1/fabric.proto is the reference.\n" +
          text_of(description));
  std::size_t open = 0;
  for (const fabric::PeriodicCurve& curve : fabric::periodic_curves(curves, tiling)) {
    open += curve.is_periodic ? 0U : 1U;
  }
  if (wanted.json) {
    print_json({{"description", wanted.out},
                {"curves", curves.size()},
                {"open_ended", open},
                {"as", wanted.as}});
    return;
  }
  fmt::print("{}: {} {} in a tile of {:g} x {:g} mm{}\n", wanted.out, curves.size(), wanted.as,
             tiling.period_mm.x, tiling.period_mm.y,
             open > 0 ? fmt::format("; {} have open ends", open) : "");
}

}  // namespace weft::cli
