// SPDX-License-Identifier: Apache-2.0
#include "dkb/dataset/odometry_track.h"

#include <fmt/format.h>

#include <algorithm>

#include "dkb/dataset/reader_source.h"
#include "dkb/util/errors.h"
#include "dkb/util/files.h"
#include "dkb/util/one_line.h"
#include "dkb/util/stamps.h"
#include "dkb/util/text_rows.h"

namespace dkb {
namespace {

class PriorSource final : public Source {
 public:
  PriorSource(std::unique_ptr<Source> source, OdometryTrack track)
      : source_(std::move(source)), track_(std::move(track)) {}

  const Camera& camera() const override { return source_->camera(); }
  SourceFrame next() override {
    SourceFrame next = source_->next();
    if (next.state != SourceState::frame) return next;
    const double now = seconds_from_ns(next.frame.stamp_ns());
    if (before_) next.frame.set_prior(track_.between(*before_, now));
    before_ = now;
    return next;
  }
  void stop() override { source_->stop(); }
  std::vector<std::string> take_warnings() override { return source_->take_warnings(); }
  SourceCounts counts() const override { return source_->counts(); }
  std::optional<size_t> size() const override { return source_->size(); }
  std::string description() const override { return source_->description(); }

 private:
  std::unique_ptr<Source> source_;
  OdometryTrack track_;
  std::optional<double> before_;  // [s] the last frame's stamp
};

}  // namespace

OdometryTrack::OdometryTrack(Trajectory odom_from_body, double drift)
    : poses_(std::move(odom_from_body)), drift_(drift) {}

std::optional<Rigid3> OdometryTrack::at(double time) const {
  const auto later = [](double t, const StampedPose& pose) { return t < pose.timestamp; };
  const auto next = std::upper_bound(poses_.begin(), poses_.end(), time, later);
  if (next == poses_.begin()) return std::nullopt;
  const StampedPose& a = *std::prev(next);
  if (a.timestamp == time) return a.world_from_cam;
  if (next == poses_.end() || next->timestamp - a.timestamp > kMaxOdometryGap) return std::nullopt;
  const double share = (time - a.timestamp) / (next->timestamp - a.timestamp);
  return interpolated(a.world_from_cam, next->world_from_cam, share);
}

std::optional<MotionPrior> OdometryTrack::between(double before, double now) const {
  const auto from = at(before), to = at(now);
  if (!from || !to) return std::nullopt;
  MotionPrior prior;
  const Rigid3 motion = from->inverse() * *to;
  prior.previous_from_current = motion;
  prior.covariance = drift_covariance(drift_, motion.translation.norm(), vector_from_rotation(motion.rotation).norm());
  if (!is_plausible(prior)) return std::nullopt;
  return prior;
}

OdometryTrack read_odometry(const std::filesystem::path& path) {
  const std::string text = read_file(path);
  double drift = kUsualDrift;
  constexpr std::string_view key = "# drift ";
  if (text.starts_with(key)) {
    const std::string_view value = std::string_view(text).substr(key.size(), text.find_first_of("\r\n") - key.size());
    drift = read_number(value, path.string() + ":1", "drift");
    if (!(drift >= 0 && drift <= 1))
      throw InputError(path.string() + ":1: drift " + excerpt(value) +
                       " is out of range; it is the share of a way that its length is off by, 0 ... 1");
  }
  Trajectory poses = parse_trajectory(text, path.string());
  const auto same_time = [](const StampedPose& a, const StampedPose& b) { return a.timestamp == b.timestamp; };
  poses.erase(std::unique(poses.begin(), poses.end(), same_time), poses.end());
  if (poses.size() < 2)
    throw InputError(path.string() + ": holds " + std::to_string(poses.size()) +
                     " poses; motion needs at least 2 at different times");
  return {std::move(poses), drift};
}

std::unique_ptr<Source> with_prior(std::unique_ptr<Source> source, OdometryTrack track) {
  return std::make_unique<PriorSource>(std::move(source), std::move(track));
}

std::unique_ptr<Source> with_prior_file(std::unique_ptr<Source> source, const std::filesystem::path& path) {
  OdometryTrack track = read_odometry(path);
  if (const auto* recording = dynamic_cast<const ReaderSource*>(source.get())) {
    const std::vector<int64_t> stamps = recording->stamps_ns();
    if (!stamps.empty() &&
        (seconds_from_ns(stamps.back()) < track.first() || seconds_from_ns(stamps.front()) > track.last()))
      throw InputError(fmt::format(
          "{}: its times, {:.3f} ... {:.3f} s, are not those of the images, {:.3f} ... {:.3f} s", path.string(),
          track.first(), track.last(), seconds_from_ns(stamps.front()), seconds_from_ns(stamps.back())));
  }
  return with_prior(std::move(source), std::move(track));
}

}  // namespace dkb
