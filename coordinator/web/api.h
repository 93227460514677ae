#pragma once

#include <mutex>
#include <string>
#include <vector>

#include "coordinator/scheduler/scheduler.h"
#include "coordinator/web/http_server.h"
#include "coordinator/web/painter.h"
#include "security/caller.h"

namespace weft::coordinator {

// The page's data at /api/..., for programs too; docs/status_page.md lists what there is. All of it
// only reads, and asks for the role that the call of the same meaning in cluster.proto asks for.
// Any thread.
class Api {
 public:
  // Both must outlive this.
  Api(Scheduler& scheduler, Painter& painter) : scheduler_(scheduler), painter_(painter) {}

  // `path` is the part behind /api/, cut at its slashes. Throws core::Error: kNotFound when there
  // is nothing there, kPermissionDenied, and what the calls throw.
  [[nodiscard]] HttpAnswer answer(const std::vector<std::string>& path, const HttpRequest& request,
                                  const security::Caller& caller);

 private:
  [[nodiscard]] HttpAnswer jobs(const std::vector<std::string>& path, const HttpRequest& request,
                                const security::Caller& caller);
  [[nodiscard]] HttpAnswer workers(const std::vector<std::string>& path,
                                   const security::Caller& caller);
  [[nodiscard]] HttpAnswer fabrics(const std::vector<std::string>& path,
                                   const security::Caller& caller);
  [[nodiscard]] HttpAnswer explanation(const std::string& job, const HttpRequest& request);
  [[nodiscard]] HttpAnswer log(const std::string& job, const std::string& attempt,
                               const HttpRequest& request);
  [[nodiscard]] HttpAnswer difference(const HttpRequest& request);
  [[nodiscard]] HttpAnswer node();

  Scheduler& scheduler_;
  Painter& painter_;
  std::mutex comparing_;  // versions are compared one pair at a time
};

}  // namespace weft::coordinator
