// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <filesystem>
#include <functional>
#include <stop_token>
#include <string>
#include <vector>

#include "base/temporary_folder.h"
#include "store/packing/pack_temporal.h"

namespace raystage::cli {

/// What encoding costs in rendered views: `raystage evaluate` renders a few views from frames of
/// the take and from encoded ones, and compares both with the same truth: images of a views
/// document, or the frames of cameras that do not contribute, as the take has them. Frames are
/// a few in the middle of the take, or with a views document all.
class ViewLoss {
 public:
  struct Settings {
    std::string method = "depth";
    std::filesystem::path views;  ///< empty: cameras are left out
    int frames = 12;              ///< of each camera, if cameras are left out
    store::References references = store::References::kTime;
    int threads = 0;  ///< as the option of commands
  };
  /// Writes excerpts of the take into a temporary folder next to `target`, which is removed with
  /// this object. Renders the views from the take. Throws Error (bad input or failed) if that is
  /// impossible.
  ViewLoss(const store::Take& take, const std::filesystem::path& target, Settings settings,
           std::stop_token stop);
  ViewLoss(const ViewLoss&) = delete;
  ViewLoss& operator=(const ViewLoss&) = delete;

  /// Returns the mean PSNR of the views from the take's frames minus that from frames encoded with
  /// these settings, dB.
  double loss_db(const store::VideoSettings& video) const;
  double reference_db() const { return reference_db_; }  ///< from the take's frames
  std::string truth() const;                             ///< says what the views are compared with

 private:
  void choose_frames();
  void choose_frames_of_views();
  double psnr_of(const std::string& name) const;

  const store::Take& take_;
  const TemporaryFolder folder_;
  const Settings settings_;
  const std::stop_token stop_;
  store::Excerpt excerpt_;
  int view_step_ = 1;
  double reference_db_ = 0;
};

/// Returns the largest rate factor, in whole steps from `least` to `most`, whose loss is at most
/// `target_db`, by bisection: the loss is taken to grow with the factor. Calls `loss_of` for each
/// factor that is tried. Throws Error (bad input), which names the take, if `least` loses more.
double largest_crf_within(const std::string& take, double target_db, int least, int most,
                          const std::function<double(double)>& loss_of);

}  // namespace raystage::cli
