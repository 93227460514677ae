#include <algorithm>
#include <charconv>
#include <cstdio>
#include <filesystem>
#include <memory>
#include <string>
#include <vector>

#include <CLI/CLI.hpp>
#include <nlohmann/json.hpp>

#include "cli/add_command.h"
#include "cli/commands.h"
#include "cli/estimate.h"
#include "cli/import_curves.h"
#include "cli/output_file.h"
#include "cli/print_json.h"
#include "cli/progress.h"
#include "core/error.h"
#include "core/file.h"
#include "fabric/description.h"
#include "fabric/description_check.h"
#include "fabric/draft.h"
#include "fabric/read_draft.h"
#include "fabric/wif_file.h"
#include "fabric/wif_import.h"
#include "fabric/wif_write.h"

namespace weft::cli {

namespace {

// Beyond these a crop or fewer fibres are offered.
constexpr std::uint64_t kManySegments = 2'000'000;
constexpr double kManyCoreSeconds = 8 * 3600;
constexpr std::uint32_t kOfferedThreads = 24;

struct ImportCommand {
  std::string draft;
  std::string out;
  std::string name;
  std::string crop_ends;
  std::string crop_picks;
  double fibre_share = 1;
  CurveImport curves;
  bool json = false;
};

struct Range {
  std::uint32_t first = 0;
  std::uint32_t count = 0;
};

// "A:N": N threads from thread A on.
Range parse_range(const std::string& text, const std::string& flag) {
  Range range;
  if (text.empty()) {
    return range;
  }
  const std::size_t colon = std::min(text.find(':'), text.size());
  const char* begin = text.data();
  const char* end = begin + text.size();
  const auto first = std::from_chars(begin, begin + colon, range.first);
  const bool has_count = colon + 1 < text.size();
  const auto count = has_count ? std::from_chars(begin + colon + 1, end, range.count)
                               : std::from_chars_result{end, std::errc::invalid_argument};
  if (first.ec != std::errc() || first.ptr != begin + colon || count.ec != std::errc() ||
      count.ptr != end || range.first == 0 || range.count == 0) {
    throw CLI::ValidationError(flag, text +
                                         " is no range; write A:N for N threads from A on, "
                                         "counted from 1, such as 1:24");
  }
  return range;
}

// Where a draft of another format is written as WIF, for a description that must refer to it.
std::filesystem::path wif_beside(const ImportCommand& command) {
  return std::filesystem::path(command.out).replace_extension(".wif");
}

fabric::ImportOptions import_options(const ImportCommand& command, bool is_wif) {
  fabric::ImportOptions options;
  const std::filesystem::path draft(command.draft);
  options.name =
      command.name.empty() ? fabric::name_from_file(draft.stem().string()) : command.name;
  if (!fabric::is_name(options.name)) {
    throw core::Error(
        core::Code::kInvalidArgument,
        "--name " + options.name + " is no name; use small letters, digits, _ and -, at most 64");
  }
  const std::filesystem::path folder = std::filesystem::absolute(command.out).parent_path();
  options.draft_name = std::filesystem::proximate(draft, folder).string();
  options.wif_reference = is_wif ? options.draft_name : wif_beside(command).filename().string();
  const Range ends = parse_range(command.crop_ends, "--crop-ends");
  const Range picks = parse_range(command.crop_picks, "--crop-picks");
  options.crop.set_first_end(ends.first);
  options.crop.set_ends(ends.count);
  options.crop.set_first_pick(picks.first);
  options.crop.set_picks(picks.count);
  options.fibre_share = command.fibre_share;
  return options;
}

// The estimate of what was written; or why it cannot be built as it stands.
struct Expectation {
  std::uint32_t repeat_ends = 0;
  std::uint32_t repeat_picks = 0;
  FabricEstimate estimate;
  std::string refusal;

  [[nodiscard]] bool too_large() const {
    return !refusal.empty() || estimate.tile.segments > kManySegments ||
           estimate.core_seconds > kManyCoreSeconds;
  }
};

Expectation expect(const fabric::ImportedDraft& imported, const ImportCommand& command) {
  Expectation result;
  try {
    const v1::FabricDescription description = fabric::parse_description(
        imported.text, command.out, std::filesystem::path(command.out).parent_path());
    const fabric::Draft repeat = fabric::draft_of(description.weave());
    result.repeat_ends = repeat.ends;
    result.repeat_picks = repeat.picks;
    result.estimate = estimate(description);
  } catch (const core::Error& error) {
    result.refusal = error.what();
  }
  return result;
}

std::string offer(const ImportCommand& command, const fabric::WifDraft& draft) {
  std::string again = "weft import " + command.draft + " -o " + command.out;
  return "a part of it:   " + again +
         " --crop-ends 1:" + std::to_string(std::min(kOfferedThreads, draft.warp.count)) +
         " --crop-picks 1:" + std::to_string(std::min(kOfferedThreads, draft.weft.count)) +
         "\nfewer fibres:   " + again + " --fibre-share 0.1";
}

void print_report_json(const ImportCommand& command, const fabric::WifDraft& draft,
                       const fabric::ImportedDraft& imported, const Expectation& expected) {
  nlohmann::json value = {{"description", command.out},
                          {"ends", draft.warp.count},
                          {"picks", draft.weft.count},
                          {"notes", imported.notes},
                          {"too_large", expected.too_large()}};
  if (expected.refusal.empty()) {
    value["repeat_ends"] = expected.repeat_ends;
    value["repeat_picks"] = expected.repeat_picks;
    value["fibres"] = expected.estimate.tile.fibres;
    value["segments"] = expected.estimate.tile.segments;
    value["memory_bytes"] = expected.estimate.tile.memory_bytes;
    value["core_seconds"] = expected.estimate.core_seconds;
  } else {
    value["refused"] = expected.refusal;
  }
  print_json(value);
}

void print_report(const ImportCommand& command, const fabric::WifDraft& draft,
                  const fabric::ImportedDraft& imported, const Expectation& expected) {
  for (const std::string& note : imported.notes) {
    std::printf("note: %s\n", note.c_str());
  }
  std::printf("%s: %u ends, %u picks\n", command.draft.c_str(), draft.warp.count, draft.weft.count);
  if (expected.refusal.empty()) {
    std::printf(
        "%s: repeats after %u ends and %u picks; %s fibres, %s segments, %s; about %s on "
        "one core\n",
        command.out.c_str(), expected.repeat_ends, expected.repeat_picks,
        std::to_string(expected.estimate.tile.fibres).c_str(),
        std::to_string(expected.estimate.tile.segments).c_str(),
        format_bytes(expected.estimate.tile.memory_bytes).c_str(),
        format_duration(expected.estimate.core_seconds).c_str());
  } else {
    std::printf("%s was written, but cannot be built as it stands:\n%s\n", command.out.c_str(),
                expected.refusal.c_str());
  }
  if (expected.too_large()) {
    std::printf("this is a lot; you may want\n%s\n", offer(command, draft).c_str());
  }
}

// Options that go with drafts alone, and with curves alone.
struct KindOptions {
  std::vector<const CLI::Option*> of_drafts;
  std::vector<const CLI::Option*> of_curves;
};

void refuse_options_of_the_other_kind(const ImportCommand& command, const KindOptions& options) {
  const bool curves = holds_curves(command.draft);
  for (const CLI::Option* option : curves ? options.of_drafts : options.of_curves) {
    if (option->count() > 0) {
      throw CLI::ValidationError(option->get_name(),
                                 curves ? "it is for drafts, and a .bcc file holds curves"
                                        : "it is for curves (.bcc), and this file is a draft");
    }
  }
}

void import(const ImportCommand& command) {
  if (holds_curves(command.draft)) {
    CurveImport curves = command.curves;
    curves.curves = command.draft;
    curves.out = command.out;
    curves.name = command.name;
    curves.json = command.json;
    import_curves(curves);
    return;
  }
  check_output_file(command.out);
  const std::string text = core::read_file(command.draft, fabric::kMaxWifBytes);
  const bool is_wif = fabric::draft_format(text, command.draft) == fabric::DraftFormat::kWif;
  const fabric::ImportOptions options = import_options(command, is_wif);
  const fabric::WifDraft draft = fabric::read_draft(text, command.draft);
  fabric::ImportedDraft imported = fabric::import_draft(draft, options);
  if (imported.refers && !is_wif) {
    const std::filesystem::path wif = wif_beside(command);
    if (std::filesystem::exists(wif)) {
      throw core::Error(core::Code::kAlreadyExists,
                        wif.string() +
                            " exists already, and the draft, too large to stand in the "
                            "description, would be written there; choose another -o");
    }
    core::write_file_atomically(wif, fabric::write_wif(draft));
    imported.notes.push_back(
        "the draft is too large to stand in the description; it was written as " + wif.string());
  }
  core::write_file_atomically(command.out, imported.text);
  const Expectation expected = expect(imported, command);
  if (command.json) {
    print_report_json(command, draft, imported, expected);
  } else {
    print_report(command, draft, imported, expected);
  }
}

}  // namespace

void add_import(CLI::App& app) {
  auto command = std::make_shared<ImportCommand>();  // shared: the callback outlives this function
  CLI::App* import_app = add_command(
      app, "import",
      "Make a description of a weaving draft (WIF, DTX, WPO) or of curves (BCC).\n"
      "Prints what the draft left open and what its cloth will need. The description has comments "
      "and is meant to be edited.\n"
      "Example: weft import draft.wif -o mine.textproto");
  import_app
      ->add_option("draft", command->draft,
                   "Weaving draft: .wif, Fiberworks .dtx or WeavePoint .wpo; or curves: .bcc")
      ->required();
  import_app->add_option("-o,--output,--out", command->out, "Description to write (.textproto)")
      ->required();
  import_app->add_option("--name", command->name, "Name of the fabric (default: the file's)");
  KindOptions kinds;
  kinds.of_drafts = {import_app->add_option("--crop-ends", command->crop_ends,
                                            "A:N, only N ends from end A on, counted from 1"),
                     import_app->add_option("--crop-picks", command->crop_picks,
                                            "A:N, only N picks from pick A on, counted from 1"),
                     import_app
                         ->add_option("--fibre-share", command->fibre_share,
                                      "Make only this share of the fibres, thicker")
                         ->check(CLI::Range(0.001, 1.0))
                         ->capture_default_str()};
  CurveImport& curves = command->curves;
  kinds.of_curves = {
      import_app->add_option("--period", curves.period,
                             "Curves: X,Y millimetres after which they repeat"),
      import_app->add_option("--as", curves.as, "Curves: centre lines of yarns, or single fibres")
          ->check(CLI::IsMember({"yarns", "fibres"}))
          ->capture_default_str(),
      import_app
          ->add_option("--unit-mm", curves.mm_per_unit, "Curves: millimetres per unit of the file")
          ->check(CLI::Range(1e-6, 1e6))
          ->capture_default_str(),
      import_app->add_option("--radius-mm", curves.radius_mm, "Curves: of the yarns or fibres")
          ->check(CLI::Range(1e-4, 1e3))
          ->capture_default_str()};
  import_app->add_flag("--json", command->json, "Print one JSON value");
  import_app->callback([command, kinds] {
    refuse_options_of_the_other_kind(*command, kinds);
    import(*command);
  });
}

}  // namespace weft::cli
