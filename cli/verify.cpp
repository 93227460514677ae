#include <cstdio>
#include <filesystem>
#include <memory>

#include <CLI/CLI.hpp>
#include <nlohmann/json.hpp>

#include "cli/add_command.h"
#include "cli/commands.h"
#include "cli/print_json.h"
#include "core/digest.h"
#include "core/error.h"
#include "storage/fabric_database.h"

namespace weft::cli {

void add_verify(CLI::App& app) {
  struct Options {
    std::filesystem::path file;
    bool json = false;
  };
  const auto options = std::make_shared<Options>();  // lives as long as the callback
  CLI::App* const command = add_command(app, "verify",
                                        "Check that a fabric database is whole.\n"
                                        "Recomputes its digest and reads all of it.\n"
                                        "Example: weft verify silk.h5");
  command->add_option("FILE", options->file, "Fabric database (.h5)")->required();
  command->add_flag("--json", options->json,
                    "Print one JSON value, of a damaged file too (with \"valid\": false)");
  command->callback([options] {
    nlohmann::ordered_json json{{"file", options->file.string()}};
    try {
      const core::Digest digest = storage::verify_database(options->file);
      json["valid"] = true;
      json["content_digest"] = digest.hex();
    } catch (const core::Error& error) {
      if (options->json && error.code() == core::Code::kDataLoss) {
        json["valid"] = false;
        json["error"] = error.what();
        print_json(json);
      }
      throw;
    }
    if (options->json) {
      print_json(json);
    } else {
      std::printf("%s is whole\ncontent digest %s\n", options->file.c_str(),
                  json["content_digest"].get<std::string>().c_str());
    }
  });
}

}  // namespace weft::cli
