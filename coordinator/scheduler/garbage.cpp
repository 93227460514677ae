#include "coordinator/scheduler/garbage.h"

#include <algorithm>
#include <functional>
#include <set>

#include <spdlog/spdlog.h>

#include "core/error.h"

namespace weft::coordinator {

namespace {

constexpr std::size_t kExamplesLimit = 20;

// One store, and what in it is needed.
struct Store {
  const char* kind;  // "result"
  const storage::BlobStore& blobs;
  std::set<core::Digest> needed;
  std::int64_t keep_ms;  // what is not needed is kept so long
  std::string reason;
};

// Empties before it fills, so that what a run moves to the trash stays there until another run.
class Collection {
 public:
  explicit Collection(const GarbageOrder& order) : order_(order) {}

  // Returns what was deleted for good.
  std::vector<core::Digest> empty(const Store& store) {
    std::vector<core::Digest> emptied;
    store.blobs.visit_trash([&](const storage::BlobStore::Entry& entry) {
      if (store.needed.contains(entry.digest)) {
        if (!order_.is_dry_run) {
          (void)store.blobs.use(entry.digest);  // it comes back
        }
        return;
      }
      const std::int64_t before_ms = order_.now_ms - order_.grace_ms;
      if (!order_.empties_trash || entry.used_at_ms >= before_ms) {
        return;
      }
      if (order_.is_dry_run || store.blobs.empty(entry.digest, before_ms)) {
        ++report.emptied;
        report.emptied_bytes += entry.size_bytes;
        emptied.push_back(entry.digest);
      }
    });
    return emptied;
  }

  void fill(const Store& store) {
    const std::int64_t before_ms = order_.now_ms - std::max(order_.grace_ms, store.keep_ms);
    store.blobs.visit([&](const storage::BlobStore::Entry& entry) {
      const bool goes = !store.needed.contains(entry.digest) && entry.used_at_ms < before_ms &&
                        (order_.is_dry_run || store.blobs.trash(entry.digest, before_ms));
      if (!goes) {
        ++report.kept;
        report.kept_bytes += entry.size_bytes;
        return;
      }
      ++report.removed;
      report.removed_bytes += entry.size_bytes;
      if (report.examples.size() < kExamplesLimit) {
        report.examples.push_back(std::string(store.kind) + " " + entry.digest.hex().substr(0, 12) +
                                  ", " + std::to_string(entry.size_bytes) +
                                  " bytes: " + store.reason);
      }
    });
  }

  GarbageReport report;

 private:
  const GarbageOrder& order_;
};

}  // namespace

GarbageReport collect_garbage(Scheduler& scheduler, const GarbageOrder& order) {
  // What is needed is asked for first: what becomes needed later was used by then.
  Store results{"result", scheduler.blobs(), scheduler.catalogue().published_results(),
                order.keep_unpublished_ms,
                "no version was made of it, no job has it, and nobody used it for long"};
  std::string left_alone;
  try {
    results.needed.merge(scheduler.results_in_use());
  } catch (const core::Error& error) {
    if (error.code() != core::Code::kFailedPrecondition) {
      throw;
    }
    left_alone = std::string("results are left alone: ") + error.what();
  }
  const Store pieces{"piece", scheduler.catalogue().pieces(),
                     scheduler.catalogue().needed_pieces(!order.is_dry_run), 0,
                     "no version has it"};
  Collection collection(order);
  if (left_alone.empty()) {
    const std::vector<core::Digest> emptied = collection.empty(results);
    if (!order.is_dry_run) {
      scheduler.forget_gone(emptied);
    }
    collection.fill(results);
  } else {
    collection.report.examples.push_back(left_alone);
  }
  (void)collection.empty(pieces);
  collection.fill(pieces);
  const GarbageReport& report = collection.report;
  spdlog::info("event=garbage dry_run={} kept={} removed={} removed_bytes={} emptied={}",
               order.is_dry_run, report.kept, report.removed, report.removed_bytes, report.emptied);
  return collection.report;
}

}  // namespace weft::coordinator
