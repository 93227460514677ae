#include "cli/application.h"

#include <vector>

#include "cli/commands.h"
#include "cli/recolor.h"
#include "core/program.h"

namespace weft::cli {

namespace {

using AddCommand = void (*)(CLI::App&);

// What --help and the manual list together.
struct Group {
  const char* name;
  std::vector<AddCommand> commands;
};

// One line per group; every command of commands.h is in one.
const std::vector<Group>& groups() {
  static const std::vector<Group> all{
      {"Describe a fabric", {add_new, add_import, add_preview, add_expand, add_export}},
      {"Precompute it", {add_run, add_submit, add_recolor, add_up}},
      {"Follow and steer jobs",
       {add_jobs, add_watch, add_explain, add_logs, add_pause, add_resume, add_priority, add_cancel,
        add_retry}},
      {"Workers", {add_workers, add_drain, add_unblock, add_scale}},
      {"Published fabrics",
       {add_fabrics, add_versions, add_fetch, add_log, add_diff, add_tag, add_untag, add_rollback,
        add_gc}},
      {"Pictures and databases", {add_render, add_compare, add_maps, add_inspect, add_verify}},
      {"This machine", {add_doctor, add_health, add_config, add_certs, add_completion, add_man}}};
  return all;
}

constexpr const char* kFooter =
    "'weft COMMAND --help' tells about one command, and 'weft man COMMAND' is its manual page. "
    "Most commands print one JSON value with --json.\n"
    "Examples:\n"
    "  weft new --preset silk -o silk.textproto\n"
    "  weft run silk.textproto -o silk.h5 --quality preview\n"
    "  weft render silk.h5 -o silk.exr --png silk.png";

}  // namespace

void build_application(CLI::App& app) {
  app.description("weft shows cloth as it is: from a weaving draft to a picture of every fibre.");
  app.footer(kFooter);
  core::set_program_name(app, "weft");
  app.require_subcommand(1);
  const auto count = [&app] { return app.get_subcommands([](CLI::App*) { return true; }).size(); };
  for (const Group& group : groups()) {
    const std::size_t before = count();
    for (const AddCommand add : group.commands) {
      add(app);
    }
    const auto commands = app.get_subcommands([](CLI::App*) { return true; });
    for (std::size_t i = before; i < commands.size(); ++i) {
      commands[i]->group(group.name);
    }
  }
}

}  // namespace weft::cli
