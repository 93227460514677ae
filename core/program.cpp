#include "core/program.h"

#include <cstdio>
#include <exception>

#include <spdlog/sinks/stdout_sinks.h>
#include <spdlog/spdlog.h>

#include "core/command_doc.h"
#include "core/error.h"
#include "core/help_text.h"
#include "core/man_page.h"
#include "core/settings.h"
#include "core/version.h"

namespace weft::core {

void set_program_name(CLI::App& app, const std::string& name) {
  app.name(name);
  app.set_version_flag("--version", name + " " + version(), "Print the version and end");
  app.set_help_flag("-h,--help", "Print this help and end");
  app.formatter_fn([](const CLI::App* command, const std::string& /*name*/,
                      CLI::AppFormatMode /*mode*/) { return help_text(describe(*command)); });
}

void add_log_option(CLI::App& app, std::string& level) {
  app.add_option("--log-level", level, "what is logged to stderr: debug, info, warn or error")
      ->check(CLI::IsMember({"debug", "info", "warn", "error"}))
      ->capture_default_str();
}

void start_log(const std::string& level) {
  spdlog::set_default_logger(spdlog::stderr_logger_mt("weft"));
  spdlog::set_pattern("%Y-%m-%dT%H:%M:%S.%e%z %l %v");
  spdlog::set_level(spdlog::level::from_str(level));
}

namespace {

// "weft submit": the command that was called, as far as it was understood.
std::string called_path(const CLI::App& app) {
  const auto parsed = app.get_subcommands();
  return app.get_name() + (parsed.empty() ? "" : " " + called_path(*parsed.back()));
}

std::string wrong_use(const CLI::App* app, const CLI::Error& error) {
  const std::string path = called_path(*app);
  return path + ": " + error.what() + "\n'" + path + " --help' tells how it is used\n";
}

// What shells and the build ask; nothing when it is not they who call.
std::optional<int> answer_tools(const CLI::App& app, const std::vector<std::string>& arguments,
                                const CompletionSource& source) {
  if (arguments.empty()) {
    return std::nullopt;
  }
  if (arguments.front() == "__man") {
    std::fputs(man_page(describe(app), 8).c_str(), stdout);
    return 0;
  }
  if (arguments.front() != "__complete") {
    return std::nullopt;
  }
  std::vector<std::string> words(arguments.begin() + 1, arguments.end());
  if (words.empty()) {
    words.emplace_back();
  }
  std::fputs(completions_text(complete(describe(app), words, source)).c_str(), stdout);
  return 0;
}

}  // namespace

int run_program(CLI::App& app, int argc, char** argv, const std::function<int()>& body,
                const CompletionSource& source) {
  try {
    if (const auto code = answer_tools(app, {argv + 1, argv + argc}, source)) {
      return *code;
    }
    app.failure_message(wrong_use);
    EnvironmentNames names(app);
    app.parse_complete_callback([&] {
      names.restore();
      Settings::load().apply(app);
    });
    app.parse(argc, argv);
    return body();
  } catch (const CLI::ParseError& error) {
    return app.exit(error) == 0 ? 0 : kExitWrongUse;
  } catch (const Error& error) {
    std::fprintf(stderr, "%s: %s\n", app.get_name().c_str(), error.what());
    return exit_code(error.code());
  } catch (const std::exception& error) {
    std::fprintf(stderr, "%s: internal error: %s\n", app.get_name().c_str(), error.what());
    return kExitFailed;
  }
}

}  // namespace weft::core
