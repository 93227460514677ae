#pragma once

#include <deque>
#include <string>
#include <unordered_set>

#include "coordinator/journal/journal.h"

namespace weft::coordinator {

// The request_ids of the orders that were carried out last, as many as the journal keeps.
class OrderLog {
 public:
  void add(const std::string& request_id) {
    if (!ids_.insert(request_id).second) {
      return;
    }
    order_.push_back(request_id);
    if (order_.size() > kOrdersKept) {
      ids_.erase(order_.front());
      order_.pop_front();
    }
  }
  [[nodiscard]] bool contains(const std::string& request_id) const {
    return ids_.contains(request_id);
  }

 private:
  std::unordered_set<std::string> ids_;
  std::deque<std::string> order_;  // oldest first
};

}  // namespace weft::coordinator
