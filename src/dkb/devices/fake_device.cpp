// SPDX-License-Identifier: Apache-2.0
#include "dkb/devices/fake_device.h"

#include <algorithm>
#include <chrono>
#include <cmath>
#include <deque>
#include <string_view>
#include <vector>

#include "dkb/dataset/paced_source.h"
#include "dkb/util/errors.h"
#include "dkb/util/one_line.h"
#include "dkb/util/random.h"
#include "dkb/util/settings.h"

namespace dkb {
namespace {

constexpr std::string_view kScheme = "fake:";
constexpr double kStall = 0.5;  // [s] of stalls by share
const std::vector<std::string> kKeys{"drop", "double", "swap", "late", "stall", "unplug", "seed", "speed"};

// One `key=value` of a place.
struct Parameter {
  std::string key, value;

  [[noreturn]] void refuse(const std::string& form) const {
    throw InputError("fake: " + key + "=" + value + ": must be " + form);
  }
  double number(std::string_view text, double min, double max, const std::string& form) const {
    double result = 0;
    if (!parse_number(text, &result) || !(result >= min && result <= max)) refuse(form);
    return result;
  }
  double share() const { return number(value, 0, 1, "a share of the frames, 0 ... 1"); }
};

void apply(const Parameter& p, FakeFaults* faults) {
  constexpr double kLong = 1e6;  // [s]
  if (p.key == "drop") {
    faults->drop = p.share();
  } else if (p.key == "double") {
    faults->repeat = p.share();
  } else if (p.key == "swap") {
    faults->swap = p.share();
  } else if (p.key == "late") {
    faults->late = p.share();
  } else if (p.key == "stall") {
    const std::string form = "SECONDS@AT, both in seconds, or a share of the frames, 0 ... 1";
    const size_t at = p.value.find('@');
    if (at == std::string::npos) {
      faults->stall = p.number(p.value, 0, 1, form);
    } else {
      faults->stall_for = p.number(std::string_view(p.value).substr(0, at), 0, kLong, form);
      faults->stall_at = p.number(std::string_view(p.value).substr(at + 1), 0, kLong, form);
    }
  } else if (p.key == "unplug") {
    const std::string form = "AT,FOR, both in seconds";
    const size_t comma = p.value.find(',');
    faults->unplug_at = p.number(std::string_view(p.value).substr(0, comma), 0, kLong, form);
    if (comma != std::string::npos)
      faults->unplug_for = p.number(std::string_view(p.value).substr(comma + 1), 0, kLong, form);
  } else if (p.key == "seed") {
    int64_t seed = 0;
    if (!parse_number(p.value, &seed) || seed < 0) p.refuse("a whole number of at least 0");
    faults->seed = static_cast<uint64_t>(seed);
  } else if (p.key == "speed") {
    faults->speed = p.number(p.value, 0.01, 1000, "0.01 ... 1000 times the pace of the stamps");
  } else {
    std::string known;
    for (const std::string& key : kKeys) known += (known.empty() ? "" : ", ") + key;
    throw InputError("fake: unknown parameter \"" + p.key + "\"" + did_you_mean(p.key, kKeys) + "; known: " + known);
  }
}

// The frames of a source in the order and with the gaps of a faulty device.
class FaultySource final : public Source {
 public:
  FaultySource(std::unique_ptr<Source> source, const FakeFaults& faults)
      : source_(std::move(source)), faults_(faults), random_(faults.seed) {}

  const Camera& camera() const override { return source_->camera(); }
  void stop() override { source_->stop(); }
  std::vector<std::string> take_warnings() override { return source_->take_warnings(); }
  SourceCounts counts() const override { return source_->counts(); }
  std::string description() const override { return "fake device: " + source_->description(); }

  SourceFrame next() override {
    while (ready_.empty()) {
      SourceFrame frame = source_->next();
      if (frame.state == SourceState::ended) {
        for (Held& held : held_) ready_.push_back({std::move(held.frame), due_s_});
        held_.clear();
        if (ready_.empty()) {
          // A camera that is gone has no end before it is back.
          if (gone_) handed_out_due_s_ = faults_.unplug_at + faults_.unplug_for;
          return frame;
        }
        break;
      }
      if (frame.state == SourceState::frame)
        receive(std::move(frame));
      else
        ready_.push_back({std::move(frame), due_s_});
    }
    SourceFrame frame = std::move(ready_.front().frame);
    handed_out_due_s_ = ready_.front().due_s;
    ready_.pop_front();
    return frame;
  }
  // When what next() has just given is due [s] after the first frame, at the pace of the stamps.
  double due_s() const { return handed_out_due_s_; }

 private:
  struct Timed {
    SourceFrame frame;
    double due_s = 0;
  };
  struct Held {
    SourceFrame frame;
    int behind = 0;  // comes after so many others
  };

  void receive(SourceFrame frame) {
    const int64_t stamp = frame.frame.stamp_ns();
    if (!first_) first_ = stamp;
    const double t = static_cast<double>(stamp - *first_) / 1e9;
    const bool drop = random_.uniform() < faults_.drop, repeat = random_.uniform() < faults_.repeat,
               swap = random_.uniform() < faults_.swap, late = random_.uniform() < faults_.late,
               stall = random_.uniform() < faults_.stall;
    const int lateness = 3 + static_cast<int>(random_.below(8));
    gone_ = faults_.unplug_at >= 0 && t >= faults_.unplug_at && t < faults_.unplug_at + faults_.unplug_for;
    if (gone_) {
      if (!unplugged_) {
        SourceFrame gone;
        gone.state = SourceState::unplugged;
        ready_.push_back({std::move(gone), t});
        held_.clear();
      }
      unplugged_ = true;
      return;
    }
    due_s_ = std::max(t, stalled_until_);
    if (stall) stalled_until_ = std::max(stalled_until_, t + kStall);
    if (faults_.stall_at >= 0 && t >= faults_.stall_at && t < faults_.stall_at + faults_.stall_for)
      due_s_ = stalled_until_ = std::max(stalled_until_, faults_.stall_at + faults_.stall_for);
    if (drop) return;
    if (late || swap) {
      held_.push_back({std::move(frame), late ? lateness : 1});
      return;
    }
    if (repeat) ready_.push_back({frame, due_s_});
    ready_.push_back({std::move(frame), due_s_});
    std::vector<Held> still_held;
    for (Held& held : held_) {
      if (--held.behind > 0)
        still_held.push_back(std::move(held));
      else
        ready_.push_back({std::move(held.frame), due_s_});
    }
    held_ = std::move(still_held);
  }

  const std::unique_ptr<Source> source_;
  const FakeFaults faults_;
  Random random_;
  std::deque<Timed> ready_;
  std::vector<Held> held_;
  std::optional<int64_t> first_;
  double due_s_ = 0, handed_out_due_s_ = 0, stalled_until_ = 0;
  bool unplugged_ = false, gone_ = false;  // told; now
};

}  // namespace

FakePlace parse_fake_place(const std::string& where) {
  std::string_view rest = where;
  if (rest.starts_with(kScheme)) rest.remove_prefix(kScheme.size());
  const size_t question = rest.rfind('?');
  FakePlace place;
  place.folder = std::string(rest.substr(0, question));
  if (place.folder.empty()) throw InputError("fake: names no folder; give fake:FOLDER");
  if (question == std::string_view::npos) return place;
  rest.remove_prefix(question + 1);
  while (!rest.empty()) {
    const std::string_view part = rest.substr(0, rest.find('&'));
    rest.remove_prefix(std::min(part.size() + 1, rest.size()));
    const size_t equals = part.find('=');
    apply({one_line(part.substr(0, equals)), equals == std::string_view::npos ? "" : one_line(part.substr(equals + 1))},
          &place.faults);
  }
  return place;
}

std::unique_ptr<Source> open_fake_device(const std::string& where, const SourceOptions& options) {
  const FakePlace place = parse_fake_place(where);
  auto faulty = std::make_unique<FaultySource>(open_folder(place.folder, options), place.faults);
  const auto due = [source = faulty.get(), speed = place.faults.speed](const SourceFrame&) {
    return std::optional(std::chrono::nanoseconds(std::llround(source->due_s() / speed * 1e9)));
  };
  return std::make_unique<PacedSource>(std::move(faulty), due);
}

}  // namespace dkb
