#include "coordinator/records.h"

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
  add(records, actions.results);
  add(records, actions.failures);
  return records;
}

}  // namespace weft::coordinator
