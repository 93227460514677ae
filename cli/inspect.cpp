#include <algorithm>
#include <cstdint>
#include <cstdio>
#include <filesystem>
#include <map>
#include <memory>
#include <string>
#include <vector>

#include <CLI/CLI.hpp>
#include <nlohmann/json.hpp>

#include "cli/add_command.h"
#include "cli/commands.h"
#include "cli/print_json.h"
#include "cli/progress.h"
#include "coordinator/versions/carried_over.h"
#include "storage/database_summary.h"
#include "storage/fabric_database.h"
#include "storage/recolouring.h"

namespace weft::cli {

namespace {

using Json = nlohmann::ordered_json;

// Bytes of a section, and which count they grow with.
struct Section {
  const char* path;
  const char* per;  // "segment", "cell" or nothing
};
constexpr Section kSections[] = {
    {"/exemplar", ""},
    {"/materials", ""},
    {"/cells", ""},
    {"/iirtf", "cell"},
    {"/visibility/ssdf", ""},
    {"/visibility/ssdf/coefficients", "segment"},
    {"/visibility/ssg", "segment"},
    {"/visibility/open_share", "segment"},
    {"/sg", ""},
    {"/provenance", ""},
};

std::uint64_t section_bytes(const std::vector<storage::StoredDataset>& datasets,
                            const std::string& section) {
  std::uint64_t bytes = 0;
  for (const storage::StoredDataset& dataset : datasets) {
    if (dataset.path == section || dataset.path.starts_with(section + "/")) {
      bytes += dataset.stored_bytes;
    }
  }
  return bytes;
}

// The text came with the file: what is nested deeper than any description is left out, because
// writing it out again would take as much of the stack.
Json parsed_or_text(const std::string& text) {
  constexpr int kDeepest = 64;
  const auto is_shallow = [](int depth, Json::parse_event_t, Json&) { return depth <= kDeepest; };
  Json json = Json::parse(text, is_shallow, false);
  return json.is_discarded() ? Json(text) : json;
}

std::string name_in(const Json& description) {
  const bool has_name =
      description.is_object() && description.contains("name") && description["name"].is_string();
  return has_name ? description["name"].get<std::string>() : "";
}

// Null where light was traced in the colours that the file has.
Json carried_over_of(const storage::Recolouring& recolouring) {
  if (recolouring.carried_over_json.empty()) {
    return nullptr;
  }
  const coordinator::CarriedOver carried =
      coordinator::parse_carried_over(recolouring.carried_over_json);
  return {{"base", carried.base},
          {"base_digest", carried.base_digest},
          {"light_error", carried.light_error},
          {"light_error_noise", carried.light_error_noise},
          {"matrix_error", carried.matrix_error}};
}

Json sizes_of(const storage::FabricDatabase& db, const std::filesystem::path& path) {
  const std::vector<storage::StoredDataset> datasets = storage::stored_datasets(path);
  Json sections = Json::array();
  for (const Section& section : kSections) {
    const std::string per = section.per;
    const std::uint64_t bytes = section_bytes(datasets, section.path);
    Json entry{{"section", section.path}, {"bytes", bytes}};
    if (!per.empty()) {
      const std::size_t count = per == "cell" ? db.cell_paths.size() : db.cell_of_segment.size();
      entry["bytes_per_" + per] = static_cast<double>(bytes) / static_cast<double>(count);
    }
    sections.push_back(entry);
  }
  Json list = Json::array();
  for (const storage::StoredDataset& dataset : datasets) {
    list.push_back({{"path", dataset.path},
                    {"element", dataset.element},
                    {"shape", dataset.shape},
                    {"bytes", dataset.stored_bytes}});
  }
  return {{"sections", sections}, {"datasets", list}};
}

Json summary_of(const std::filesystem::path& path) {
  const storage::RecolourableDatabase all = storage::read_recolourable(path);
  const storage::FabricDatabase& db = all.database;
  const storage::DatabaseErrors errors = storage::database_errors(db);
  const Json description = parsed_or_text(db.description_json);
  const Json stages = parsed_or_text(db.stages_json);
  const Json sizes = sizes_of(db, path);
  Json json;
  json["file"] = path.string();
  json["name"] = name_in(description);
  json["schema"] = 1;
  json["content_digest"] = storage::content_digest(path).hex();
  json["bytes"] = std::filesystem::file_size(path);
  json["software"] = db.software;
  json["size_mm"] = {db.size_mm.x, db.size_mm.y};
  json["z_bounds_mm"] = {db.z_bounds_mm.x, db.z_bounds_mm.y};
  json["blocks"] = {db.blocks.x, db.blocks.y};
  json["materials"] = db.material_names;
  json["yarns"] = db.yarn_names;
  json["threads"] = db.threads.size() / 3;
  json["fibres"] = db.strand_radius_mm.size();
  json["segments"] = db.cell_of_segment.size();
  json["mean_free_path_mm"] = db.mean_free_path_mm;
  json["sigma_shadow_mm"] = db.sigma_shadow_mm;
  json["cells"] = db.cell_paths.size();
  json["cells_per_axis"] = {db.cells_per_axis.x, db.cells_per_axis.y, db.cells_per_axis.z};
  json["sh_order"] = db.sh_order;
  json["paths_per_cell"] = {{"fewest", errors.fewest_paths}, {"most", errors.most_paths}};
  json["carried_over"] = carried_over_of(all.recolouring);
  json["can_be_recolored"] = all.recolouring.has_orders();
  json["transfer_rms"] = errors.transfer_rms;
  json["transfer_standard_error_rms"] = errors.standard_error_rms;
  json["transfer_relative_error"] =
      errors.transfer_rms > 0 ? errors.standard_error_rms / errors.transfer_rms : 0;
  json["visibility_resolution"] = db.visibility_resolution;
  json["pca_components"] = db.pca_components;
  json["ssdf_sign_error"] = db.ssdf_sign_error;
  json["sg_count"] = db.sg_count;
  json["sg_sharpness"] = db.sg_sharpness;
  json["mean_open_share"] = errors.mean_open_share;
  json["blocked_segments_share"] = errors.blocked_share;
  json["sections"] = sizes["sections"];
  json["datasets"] = sizes["datasets"];
  json["description"] = description;
  json["stages"] = stages.is_object() && stages.contains("stages") ? stages["stages"] : stages;
  return json;
}

std::string joined(const Json& names) {
  std::string text;
  for (const auto& name : names) {
    text += (text.empty() ? "" : ", ") + name.get<std::string>();
  }
  return text;
}

// Values come from the file: none of them may steer the terminal.
void print_line(const char* label, std::string value) {
  std::replace_if(
      value.begin(), value.end(),
      [](char c) { return static_cast<unsigned char>(c) < 0x20 || c == 0x7f; }, '?');
  std::printf("%-18s%s\n", label, value.c_str());
}

// printf into a string; `format` is a literal.
template <class... Values>
std::string text(const char* format, Values... values) {
  char buffer[256];
  std::snprintf(buffer, sizeof(buffer), format, values...);
  return buffer;
}

double number(const Json& json) { return json.get<double>(); }

void print_summary(const Json& json) {
  print_line("fabric", json["name"].get<std::string>());
  print_line("content digest", json["content_digest"].get<std::string>());
  print_line("made by", json["software"].get<std::string>());
  print_line("size", format_bytes(json["bytes"].get<std::uint64_t>()));
  print_line("tile", text("%.4g x %.4g mm, %.4g mm thick", number(json["size_mm"][0]),
                          number(json["size_mm"][1]),
                          number(json["z_bounds_mm"][1]) - number(json["z_bounds_mm"][0])));
  print_line("fibres", text("%.0f, in %.0f segments and %.0f threads", number(json["fibres"]),
                            number(json["segments"]), number(json["threads"])));
  print_line("yarns", joined(json["yarns"]));
  print_line("materials", joined(json["materials"]));
  print_line("mean free path", text("%.4g mm", number(json["mean_free_path_mm"])));
  print_line("shadow filter", text("%.4g mm", number(json["sigma_shadow_mm"])));
  print_line("cells", text("%.0f of a grid of %.0f x %.0f x %.0f", number(json["cells"]),
                           number(json["cells_per_axis"][0]), number(json["cells_per_axis"][1]),
                           number(json["cells_per_axis"][2])));
  print_line("transfer", text("order %.0f, %.0f to %.0f paths per cell, relative error %.2g %%",
                              number(json["sh_order"]), number(json["paths_per_cell"]["fewest"]),
                              number(json["paths_per_cell"]["most"]),
                              100 * number(json["transfer_relative_error"])));
  if (const Json& carried = json["carried_over"]; !carried.is_null()) {
    print_line("carried over", "from " + carried["base"].get<std::string>() + ", content " +
                                   carried["base_digest"].get<std::string>().substr(0, 12) +
                                   text("; light off by %.2g %% (+- %.2g %%), matrices by %.2g %%",
                                        100 * number(carried["light_error"]),
                                        100 * number(carried["light_error_noise"]),
                                        100 * number(carried["matrix_error"])));
  }
  const double resolution = number(json["visibility_resolution"]);
  print_line("visibility", text("%.0f x %.0f directions; %.3g %% of the sphere is open, %.3g %% of "
                                "the segments see no sky",
                                resolution, resolution, 100 * number(json["mean_open_share"]),
                                100 * number(json["blocked_segments_share"])));
  print_line("signed distance",
             text("%.0f components, wrong sign in %.2g %% of directions",
                  number(json["pca_components"]), 100 * number(json["ssdf_sign_error"])));
  print_line("Gaussians", text("%.0f of sharpness %.4g", number(json["sg_count"]),
                               number(json["sg_sharpness"])));
  std::printf("\n%-32s%12s\n", "section", "bytes");
  for (const Json& section : json["sections"]) {
    const std::string path = section["section"].get<std::string>();
    std::string line = text("%-32s%12.0f", path.c_str(), number(section["bytes"]));
    for (const char* per : {"segment", "cell"}) {
      const std::string key = std::string("bytes_per_") + per;
      if (section.contains(key)) {
        line += text("  %.1f per %s", number(section[key]), per);
      }
    }
    std::printf("%s\n", line.c_str());
  }
}

}  // namespace

void add_inspect(CLI::App& app) {
  struct Options {
    std::filesystem::path file;
    bool json = false;
  };
  const auto options = std::make_shared<Options>();  // lives as long as the callback
  CLI::App* const command = add_command(app, "inspect",
                                        "Show what a fabric database holds.\n"
                                        "How exact it is, and what it was made from.\n"
                                        "Example: weft inspect silk.h5");
  command->add_option("FILE", options->file, "Fabric database (.h5)")->required();
  command->add_flag("--json", options->json, "Print one JSON value on stdout");
  command->callback([options] {
    const Json json = summary_of(options->file);
    if (options->json) {
      print_json(json);
    } else {
      print_summary(json);
    }
  });
}

}  // namespace weft::cli
