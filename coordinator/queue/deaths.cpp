#include "coordinator/queue/deaths.h"

#include <algorithm>
#include <utility>

namespace weft::coordinator {

void Deaths::add(const std::string& name, const std::string& worker, Time at, Held held) {
  std::vector<Death>& deaths = by_name_[name];
  auto death = std::find_if(deaths.begin(), deaths.end(),
                            [&](const Death& known) { return known.worker == worker; });
  if (death == deaths.end()) {
    death = deaths.insert(deaths.end(), Death{worker, at, {}});
  }
  death->held.push_back(std::move(held));
}

void Deaths::take_back(const std::string& name, const std::string& worker) {
  const auto deaths = by_name_.find(name);
  if (deaths != by_name_.end()) {
    std::erase_if(deaths->second, [&](const Death& death) { return death.worker == worker; });
  }
}

void Deaths::forget_before(Time time) {
  for (auto& [name, deaths] : by_name_) {
    std::erase_if(deaths, [time](const Death& death) { return death.at < time; });
  }
  std::erase_if(by_name_, [](const auto& entry) { return entry.second.empty(); });
}

void Deaths::shift(std::chrono::milliseconds by) {
  for (auto& [name, deaths] : by_name_) {
    for (Death& death : deaths) {
      death.at += by;
    }
  }
}

std::size_t Deaths::elsewhere(const std::string& name,
                              const std::function<bool(const Held&)>& is_concerned) const {
  const auto deaths = by_name_.find(name);
  if (deaths == by_name_.end()) {
    return 0;
  }
  return static_cast<std::size_t>(
      std::count_if(deaths->second.begin(), deaths->second.end(), [&](const Death& death) {
        return std::none_of(death.held.begin(), death.held.end(), is_concerned);
      }));
}

}  // namespace weft::coordinator
