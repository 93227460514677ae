#include <cstdio>
#include <string>

#include <CLI/CLI.hpp>

#include "cli/application.h"
#include "cli/known_names.h"
#include "core/mistakes.h"
#include "core/program.h"
#include "security/grpc_setup.h"

namespace {

// CLI11 would only say that a word was not expected.
bool is_unknown_command(const CLI::App& app, const std::string& word) {
  if (word.empty() || word.starts_with('-') || word.starts_with("__")) {
    return false;
  }
  std::vector<std::string> names;
  for (const CLI::App* command : app.get_subcommands({})) {
    if (command->check_name(word)) {
      return false;
    }
    names.push_back(command->get_name());
  }
  std::fprintf(stderr, "weft: there is no command %s%s\n'weft --help' lists them\n",
               weft::core::in_quotes(word).c_str(), weft::core::suggestion(word, names).c_str());
  return true;
}

}  // namespace

int main(int argc, char** argv) {
  CLI::App app;
  weft::cli::build_application(app);
  if (argc > 1 && is_unknown_command(app, argv[1])) {
    return weft::core::kExitWrongUse;
  }
  weft::security::set_up_grpc(weft::security::GrpcSays::kNothing);
  return weft::core::run_program(
      app, argc, argv, [] { return 0; }, weft::cli::known_names(app));
}
