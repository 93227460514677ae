#include <cstdio>

#include <CLI/CLI.hpp>

#include "cli/commands.h"
#include "core/program.h"
#include "security/grpc_setup.h"

int main(int argc, char** argv) {
  namespace cli = weft::cli;
  namespace core = weft::core;
  CLI::App app{"weft shows cloth as it is: from a weaving draft to a picture of every fibre."};
  core::set_program_name(app, "weft");
  app.require_subcommand(1);
  // One line per command, in the order of commands.h.
  cli::add_new(app);
  cli::add_import(app);
  cli::add_preview(app);
  cli::add_export(app);
  cli::add_run(app);
  cli::add_up(app);
  cli::add_submit(app);
  cli::add_jobs(app);
  cli::add_watch(app);
  cli::add_explain(app);
  cli::add_logs(app);
  cli::add_pause(app);
  cli::add_resume(app);
  cli::add_priority(app);
  cli::add_cancel(app);
  cli::add_retry(app);
  cli::add_workers(app);
  cli::add_drain(app);
  cli::add_unblock(app);
  cli::add_fabrics(app);
  cli::add_versions(app);
  cli::add_fetch(app);
  cli::add_log(app);
  cli::add_diff(app);
  cli::add_tag(app);
  cli::add_untag(app);
  cli::add_rollback(app);
  cli::add_gc(app);
  cli::add_inspect(app);
  cli::add_verify(app);
  cli::add_render(app);
  cli::add_compare(app);
  cli::add_certs(app);
  const auto is_named = [argv](const CLI::App* command) { return command->check_name(argv[1]); };
  if (argc > 1 && argv[1][0] != '-' && app.get_subcommands(is_named).empty()) {
    std::fprintf(stderr, "weft: there is no command '%s'; weft --help lists them\n", argv[1]);
    return core::kExitWrongUse;
  }
  weft::security::set_up_grpc(weft::security::GrpcSays::kNothing);
  return core::run_program(app, argc, argv, [] { return 0; });
}
