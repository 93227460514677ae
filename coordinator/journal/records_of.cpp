#include "coordinator/journal/records_of.h"

namespace weft::coordinator {

namespace {

template <class Kind>
void add(std::vector<Record>& records, const std::vector<Kind>& more) {
  records.insert(records.end(), more.begin(), more.end());
}

}  // namespace

std::vector<Record> records_of(const Actions& actions) {
  std::vector<Record> records;
  add(records, actions.bound);
  add(records, actions.results_dropped);
  add(records, actions.results);
  add(records, actions.audits);
  add(records, actions.failures);
  add(records, actions.failures_dropped);
  add(records, actions.blocks);
  add(records, actions.attempts_begun);
  add(records, actions.attempts_ended);
  add(records, actions.mismatches);
  return records;
}

}  // namespace weft::coordinator
