// SPDX-License-Identifier: Apache-2.0
#include "dkb_slam/frame.h"

#include <cmath>
#include <iterator>

#include "dkb/geometry/decompositions.h"
#include "dkb/geometry/motion_model.h"
#include "dkb/geometry/rigid3.h"
#include "dkb/image/given_motion.h"
#include "dkb/image/image.h"
#include "dkb/image/pixel_views.h"
#include "dkb/image/rgbd_image.h"
#include "dkb/util/errors.h"
#include "dkb/util/stamps.h"

namespace dkb {
namespace {

std::string size_text(int width, int height) {
  return std::to_string(width) + " x " + std::to_string(height);
}

void check_view(const ImageView& view, bool is_depth, const Camera& camera) {
  const std::string name = is_depth ? "depth image" : "colour image";
  if (view.data == nullptr) throw InputError(name + ": its data is null; give a buffer of the camera's size");
  const bool depth_format = view.format == PixelFormat::depth_u16 || view.format == PixelFormat::depth_f32;
  if (static_cast<unsigned>(view.format) > static_cast<unsigned>(PixelFormat::depth_f32) || depth_format != is_depth)
    throw InputError(name + ": its format is " + name_of(view.format) + "; it must be " +
                     (is_depth ? "depth_u16 or depth_f32" : "rgb8, bgr8, rgba8, bgra8 or grey8"));
  if (view.width != camera.width || view.height != camera.height)
    throw InputError(name + ": it is of " + size_text(view.width, view.height) + " px, the camera of " +
                     size_text(camera.width, camera.height) + "; give images of the camera's size");
  if (view.stride != 0 && view.stride < view.row_bytes())
    throw InputError(name + ": its stride of " + std::to_string(view.stride) + " bytes is less than the " +
                     std::to_string(view.row_bytes()) + " of a row");
}

// A depth image is carried to the colour image by the motion between them.
void check_depth_stamp(int64_t stamp_ns, int64_t depth_stamp_ns) {
  const double gap = seconds_from_ns(depth_stamp_ns) - seconds_from_ns(stamp_ns);
  if (std::abs(gap) <= kEvenMotion) return;
  throw InputError("depth image: its stamp (depth_stamp_ns) is " + stamp_text(depth_stamp_ns) +
                   " s, that of the colour image " + stamp_text(stamp_ns) +
                   " s; they may be 0.2 s apart: give both in nanoseconds of one clock, or leave depth_stamp_ns out");
}

void check_prior(const MotionPrior& prior) {
  const Rigid3& m = prior.previous_from_current;
  if (!m.translation.allFinite() || !m.rotation.coeffs().allFinite() || !prior.covariance.allFinite())
    throw InputError("motion prior: one of its numbers is not finite; leave the prior out of this frame");
  if (!is_rigid(m, kGivenNorm)) throw InputError("motion prior: its rotation is no unit quaternion; normalise it");
  if (!is_symmetric(prior.covariance))
    throw InputError("motion prior: its covariance is not symmetric; give a covariance matrix");
  if (spectrum(prior.covariance).values[0] < -1e-12 * prior.covariance.cwiseAbs().maxCoeff())
    throw InputError(
        "motion prior: its covariance has a negative variance in some direction; give a covariance matrix");
}

template <class T>
ImageView view_of(const Image<T>& image, PixelFormat format) {
  if (image.empty()) return {};
  return {image.data(), image.width(), image.height(), 0, format};
}

}  // namespace

const char* name_of(PixelFormat format) {
  static constexpr const char* names[] = {"rgb8", "bgr8", "rgba8", "bgra8", "grey8", "depth_u16", "depth_f32"};
  const auto i = static_cast<size_t>(format);
  return i < std::size(names) ? names[i] : "unknown";
}

int bytes_per_pixel(PixelFormat format) {
  static constexpr int bytes[] = {3, 3, 4, 4, 1, 2, 4};
  const auto i = static_cast<size_t>(format);
  return i < std::size(bytes) ? bytes[i] : 0;
}

MotionPrior joined(const MotionPrior& first, const MotionPrior& second) {
  MotionPrior sum;
  sum.previous_from_current = first.previous_from_current * second.previous_from_current;
  sum.rotation_only = first.rotation_only || second.rotation_only;
  // A exp(a) B exp(b) = A B exp(Ad a) exp(b) with the adjoint of B's inverse.
  const Matrix6d carry = adjoint(second.previous_from_current.inverse());
  sum.covariance = carry * first.covariance * carry.transpose() + second.covariance;
  return sum;
}

Frame::Frame(const Camera& camera, const FrameInput& input) : stamp_ns_(input.stamp_ns), prior_(input.prior) {
  depth_stamp_ns_ = input.depth_stamp_ns.value_or(stamp_ns_);
  check_view(input.colour, false, camera);
  check_view(input.depth, true, camera);
  check_depth_stamp(stamp_ns_, depth_stamp_ns_);
  if (prior_) check_prior(*prior_);
  auto image = std::make_shared<RgbdImage>();
  image->timestamp = seconds_from_ns(stamp_ns_);
  image->depth_timestamp = seconds_from_ns(depth_stamp_ns_);
  if (input.colour.format == PixelFormat::grey8) {
    image->grey = copy_grey(input.colour);
  } else {
    image->colour = copy_colour(input.colour);
    image->grey = grey_from_colour(image->colour);
  }
  image->depth = copy_depth(input.depth, camera);
  leave_out_masked(camera, image->depth);
  image_ = std::move(image);
}

Frame::Frame(std::shared_ptr<const RgbdImage> image, int64_t stamp_ns, int64_t depth_stamp_ns)
    : image_(std::move(image)), stamp_ns_(stamp_ns), depth_stamp_ns_(depth_stamp_ns) {}

void Frame::set_prior(const std::optional<MotionPrior>& prior) {
  if (prior) check_prior(*prior);
  prior_ = prior;
}

ImageView Frame::colour() const {
  return image_ == nullptr ? ImageView{} : view_of(image_->colour, PixelFormat::rgb8);
}
ImageView Frame::grey() const {
  return image_ == nullptr ? ImageView{} : view_of(image_->grey, PixelFormat::grey8);
}
ImageView Frame::depth() const {
  return image_ == nullptr ? ImageView{} : view_of(image_->depth, PixelFormat::depth_f32);
}

DetectorInput detector_input(const Frame& frame) {
  return {frame.stamp_ns(), frame.colour(), frame.grey(), frame.depth()};
}

}  // namespace dkb
