#pragma once

#include <functional>
#include <stdexcept>
#include <string>

#include <CLI/CLI.hpp>

namespace weft::cli {

// Each command lives in cli/<command>.cpp and adds itself to the application: it declares its flags
// and sets a callback that runs it. The callback returns normally on success and throws core::Error
// otherwise; main prints the error and turns its code into the exit code.
void add_new(CLI::App& app);      // new --preset silk: start a description
void add_import(CLI::App& app);   // import DRAFT.wif -o FABRIC.textproto
void add_preview(CLI::App& app);  // draw the geometry
void add_expand(CLI::App& app);   // a description in full
void add_export(CLI::App& app);   // fibres as curves for other programs
void add_maps(CLI::App& app);     // pictures of one tile for other renderers
void add_run(CLI::App& app);      // the whole precomputation in one process
void add_up(CLI::App& app);       // a local cluster
void add_submit(CLI::App& app);
void add_jobs(CLI::App& app);
void add_watch(CLI::App& app);
void add_explain(CLI::App& app);
void add_logs(CLI::App& app);
void add_pause(CLI::App& app);
void add_resume(CLI::App& app);
void add_priority(CLI::App& app);
void add_cancel(CLI::App& app);
void add_retry(CLI::App& app);
void add_workers(CLI::App& app);
void add_drain(CLI::App& app);
void add_unblock(CLI::App& app);
void add_health(CLI::App& app);  // for probes
void add_scale(CLI::App& app);   // workers on engines that exist: Slurm
void add_fabrics(CLI::App& app);
void add_versions(CLI::App& app);
void add_fetch(CLI::App& app);
void add_log(CLI::App& app);
void add_diff(CLI::App& app);
void add_tag(CLI::App& app);
void add_untag(CLI::App& app);
void add_rollback(CLI::App& app);
void add_gc(CLI::App& app);
void add_inspect(CLI::App& app);
void add_verify(CLI::App& app);
void add_render(CLI::App& app);
void add_compare(CLI::App& app);
void add_doctor(CLI::App& app);
void add_config(CLI::App& app);
void add_certs(CLI::App& app);
void add_completion(CLI::App& app);
void add_man(CLI::App& app);

}  // namespace weft::cli
