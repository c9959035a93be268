// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <filesystem>
#include <map>
#include <memory>
#include <stop_token>
#include <string>
#include <vector>

#include "base/time.h"
#include "evaluation/evaluation.h"
#include "schemas/views_document.h"
#include "store/packing/pack_temporal.h"

namespace raystage::cli {

/// What encoding costs in rendered views: a few views are rendered from the frames of the take and
/// from encoded ones, and both compared with the same truth: images of a views document, or the
/// frames of cameras that do not contribute, as the take has them. Frames are those of one group in
/// the middle of the take, or with a views document all.
class ViewLoss {
 public:
  struct Settings {
    std::string method = "depth";
    std::filesystem::path views;  ///< empty: cameras are left out
    int group_frames = 12;
  };
  /// `folder`: for excerpts of the take; it is removed with this object. Renders the views from the
  /// take. Throws Error as evaluation::evaluate_views() and store::pack_excerpt().
  ViewLoss(const store::Take& take, std::filesystem::path folder, Settings settings,
           std::stop_token stop);
  ~ViewLoss();
  ViewLoss(const ViewLoss&) = delete;
  ViewLoss& operator=(const ViewLoss&) = delete;

  /// Returns the mean over the views of the PSNR from the take's frames minus that from frames
  /// encoded with these settings, dB.
  double loss_db(const store::VideoSettings& video) const;
  /// Mean PSNR of the views from the take's frames, dB.
  double reference_db() const;
  std::size_t view_count() const { return references_.size(); }
  std::string truth() const;  ///< says what the views are compared with

 private:
  struct Reference {
    store::RgbImage truth;
    std::vector<std::uint8_t> covered;
    double psnr_db = 0;
  };
  void choose_frames();
  void evaluate(const std::filesystem::path& excerpt,
                const std::function<void(const evaluation::EvaluatedView&)>& on_view) const;

  const store::Take& take_;
  const std::filesystem::path folder_;
  const Settings settings_;
  const std::stop_token stop_;
  schemas::ViewsDocument views_;
  evaluation::EvaluationOptions options_;
  Nanoseconds first_ = 0, last_ = 0;
  std::map<std::string, Reference> references_;
};

/// Returns the largest rate factor, in whole steps from `least`, whose loss is at most
/// `target_db`, by bisection: the loss is taken to grow with the factor. `loss_of` is called for
/// each factor that is tried. If not even `least` holds the target, throws Error (bad input).
double largest_crf_within(double target_db, int least, int most,
                          const std::function<double(double)>& loss_of);

}  // namespace raystage::cli
