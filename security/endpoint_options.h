#pragma once

#include <CLI/CLI.hpp>

#include "security/endpoint.h"

namespace weft::security {

// Adds --tls-folder (environment WEFT_TLS_FOLDER) and --insecure, for programs that listen and for
// those that call.
inline void add_security_options(CLI::App& command, Endpoint& endpoint) {
  command
      .add_option(
          "--tls-folder", endpoint.tls_folder,
          "Folder of certificate and key, from 'weft certs issue': talk encrypted, and only\n"
          "with those whom the same authority knows")
      ->envname("WEFT_TLS_FOLDER");
  command.add_flag("--insecure", endpoint.insecure,
                   "Without --tls-folder: talk to other machines though nothing is encrypted and\n"
                   "nobody is asked who they are");
}

}  // namespace weft::security
