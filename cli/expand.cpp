#include <iostream>
#include <iterator>
#include <memory>
#include <string>

#include <CLI/CLI.hpp>
#include <google/protobuf/util/json_util.h>

#include "cli/add_command.h"
#include "cli/commands.h"
#include "cli/output_file.h"
#include "cli/quality.h"
#include "core/check.h"
#include "core/error.h"
#include "core/file.h"
#include "fabric/description.h"
#include "proto/limits.h"

namespace weft::cli {

namespace {

constexpr const char* kHelp =
    "Write a description out in full, as JSON.\n"
    "Every file that it names stands in it, every preset and default is filled in, and mistakes "
    "are\n"
    "reported with their places: what a coordinator is sent, for programs that send it.\n"
    "FABRIC may be -, for JSON on standard input.\n"
    "Example: weft expand examples/tiny.textproto -o tiny.json";

struct ExpandOptions {
  std::string fabric;
  std::string out;
  std::string quality;
};

std::string standard_input() {
  std::string text;
  std::string chunk(std::size_t{1} << 16, '\0');
  while (std::cin.read(chunk.data(), static_cast<std::streamsize>(chunk.size())),
         std::cin.gcount() > 0) {
    text.append(chunk, 0, static_cast<std::size_t>(std::cin.gcount()));
    if (text.size() > v1::kDescriptionLimitBytes) {
      throw core::Error(core::Code::kResourceExhausted,
                        "the description on standard input is longer than 4 MiB");
    }
  }
  return text;
}

void expand(const ExpandOptions& options) {
  if (!options.out.empty()) {
    check_output_file(options.out);
  }
  const v1::Quality quality = parse_quality(options.quality);
  const v1::FabricDescription description =
      options.fabric == "-"
          ? fabric::parse_description(standard_input(), "stdin.json", ".", quality)
          : fabric::load_description(options.fabric, quality);
  google::protobuf::util::JsonPrintOptions print;
  print.preserve_proto_field_names = true;
  print.add_whitespace = true;
  std::string json;
  CHECK(google::protobuf::util::MessageToJsonString(description, &json, print).ok());
  if (options.out.empty()) {
    std::fwrite(json.data(), 1, json.size(), stdout);
  } else {
    core::write_file_atomically(options.out, json);
  }
}

}  // namespace

void add_expand(CLI::App& app) {
  auto options = std::make_shared<ExpandOptions>();  // shared: the callback outlives this function
  CLI::App* command = add_command(app, "expand", kHelp);
  command->add_option("fabric", options->fabric, "Description: a .textproto or .json file, or -")
      ->required();
  command->add_option("-o,--output", options->out, "File to write (default: standard output)");
  add_quality_option(*command, options->quality);
  command->callback([options] { expand(*options); });
}

}  // namespace weft::cli
