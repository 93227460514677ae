#include "tests/simulation/client.h"

#include <utility>

namespace weft::simulation {

void Client::insist(Order order, Then answered) {
  ++waiting_;
  ask(order, std::make_shared<bool>(false), answered);
}

// Orders do not outlive their connections: one that was given up does not arrive after the next.
void Client::ask(const Order& order, const std::shared_ptr<bool>& is_answered,
                 const Then& answered) {
  const auto lost = [this] { return ground_.happens(ground_.weather.lost_messages); };
  if (!lost()) {
    ground_.timeline.after(ground_.between(0, 10), [=, this] {
      if (!coordinator_.is_up()) {
        return;
      }
      order([=, this] {
        if (lost()) {
          return;
        }
        ground_.timeline.after(ground_.between(0, 10), [=, this] {
          if (!std::exchange(*is_answered, true)) {
            --waiting_;
            answered();
          }
        });
      });
    });
  }
  ground_.timeline.after(ground_.between(2'000, 10'000), [=, this] {
    if (!*is_answered) {
      ask(order, is_answered, answered);
    }
  });
}

void Client::submit(const JobRow& job, Then then) {
  insist([=, this](auto done) { coordinator_.submit(job, std::move(done)); },
         [=, this] {
           checks_.submitted(job.id);
           then();
         });
}

void Client::cancel(const std::string& job, Then then) {
  cancelled_.insert(job);
  insist([=, this](auto done) { coordinator_.cancel(job, std::move(done)); },
         [=, this] {
           checks_.cancelled(job);
           then();
         });
}

void Client::retry(const std::string& job, Then then) {
  checks_.retried(job);
  insist([=, this](auto done) { coordinator_.retry(job, std::move(done)); }, std::move(then));
}

void Client::unblock(const std::string& worker, StageName stage, Then then) {
  insist([=, this](auto done) { coordinator_.unblock(worker, stage, std::move(done)); },
         std::move(then));
}

void Client::pause(const std::string& job, bool is_paused, Then then) {
  checks_.paused(job, std::nullopt);
  insist([=, this](auto done) { coordinator_.pause(job, is_paused, std::move(done)); },
         [=, this] {
           checks_.paused(job, is_paused);
           then();
         });
}

void Client::prioritise(const std::string& job, std::int32_t priority, Then then) {
  insist([=, this](auto done) { coordinator_.prioritise(job, priority, std::move(done)); },
         std::move(then));
}

void Client::drain(const std::string& worker, bool is_drained, Then then) {
  checks_.drained(worker, std::nullopt);
  insist([=, this](auto done) { coordinator_.drain(worker, is_drained, std::move(done)); },
         [=, this] {
           checks_.drained(worker, is_drained);
           then();
         });
}

}  // namespace weft::simulation
