#include <cstdio>
#include <cstdlib>
#include <filesystem>
#include <memory>
#include <string>

#include <unistd.h>

#include "cli/add_command.h"
#include "cli/commands.h"
#include "core/error.h"
#include "core/file.h"
#include "core/folder.h"
#include "core/man_page.h"
#include "core/mistakes.h"

namespace weft::cli {

namespace {

constexpr const char* kHelp =
    "Show the manual page of weft or of one of its commands.\n"
    "On a terminal through man(1), elsewhere as its source.\n"
    "Examples: weft man submit\n"
    "          weft man --all share/man/man1";

struct ManOptions {
  std::string command;
  std::string folder;
};

// Replaces this process by the reader; returns when there is none.
void show(const std::string& page) {
  std::FILE* file = std::tmpfile();
  if (file == nullptr) {
    return;
  }
  std::fwrite(page.data(), 1, page.size(), file);
  std::rewind(file);
  dup2(fileno(file), STDIN_FILENO);
  execlp("man", "man", "-l", "-", static_cast<char*>(nullptr));
}

void write_all(const core::CommandDoc& program, const std::filesystem::path& folder) {
  core::make_folder(folder);
  const auto write = [&](const core::CommandDoc& doc) {
    core::write_file_atomically(folder / (core::man_page_name(doc) + ".1"), core::man_page(doc, 1));
  };
  write(program);
  for (const core::CommandDoc& command : program.commands) {
    write(command);
  }
}

void run(const CLI::App& app, const ManOptions& options) {
  const core::CommandDoc program = core::describe(app);
  if (!options.folder.empty()) {
    write_all(program, options.folder);
    return;
  }
  const core::CommandDoc* doc = options.command.empty() ? &program : program.find(options.command);
  if (doc == nullptr) {
    throw core::Error(
        core::Code::kNotFound,
        "there is no command " + core::in_quotes(options.command) + "; weft --help lists them");
  }
  const std::string page = core::man_page(*doc, 1);
  if (isatty(STDOUT_FILENO) == 1) {
    show(page);
  }
  std::fputs(page.c_str(), stdout);
}

}  // namespace

void add_man(CLI::App& app) {
  auto options = std::make_shared<ManOptions>();
  CLI::App* command = add_command(app, "man", kHelp);
  CLI::Option* about = command->add_option("command", options->command, "Which; default: weft");
  command
      ->add_option("--all", options->folder,
                   "Write the pages of weft and all its commands into this folder")
      ->excludes(about);
  command->callback([&app, options] { run(app, *options); });
}

}  // namespace weft::cli
