// SPDX-License-Identifier: Apache-2.0
// Fits contrast and brightness per camera and channel (thesis 4.3, eq. 4.1: displayed = brightness
// + contrast * intensity). Method: linear least squares over targets of different brightness.
// Vignetting (vignetting.h) and gain maps (gain_map.h) depend on the black level and contrast on
// them, so the fits alternate three times. Inputs: linear means per camera, target and cell, full
// scale 1. Cost: cameras times targets, and cells with vignetting.
#include "calibrate/color/flat_field_match.h"

#include <fmt/format.h>

#include <algorithm>

#include "base/error.h"
#include "calibrate/color/color_difference.h"
#include "calibrate/color/gain_map.h"
#include "calibrate/color/vignetting.h"
#include "calibrate/geometry/calibration_verdict.h"

namespace raystage::calibrate {
namespace {

/// Returns the target's light according to a camera's mean over the centre of its picture.
schemas::Rgb target_light(const schemas::PhotometricResponse& response,
                          const FlatFieldMeasurement& measurement) {
  const schemas::Rgb left = mean_centre_transmission(response, measurement.size);
  schemas::Rgb light{};
  for (std::size_t c = 0; c < 3; ++c) {
    light[c] = (response.brightness[c] + response.contrast[c] * measurement.mean[c]) / left[c];
  }
  return light;
}

/// Line of one channel: light of the reference = brightness + contrast * measured.
struct Line {
  double brightness = 0, contrast = 1;
};

Line fitted(const std::vector<double>& measured, const std::vector<double>& reference) {
  const auto count = static_cast<double>(measured.size());
  double x = 0, y = 0, xx = 0, xy = 0;
  for (std::size_t i = 0; i < measured.size(); ++i) {
    x += measured[i];
    y += reference[i];
    xx += measured[i] * measured[i];
    xy += measured[i] * reference[i];
  }
  const double spread = xx - x * x / count;
  constexpr double kApart = 1e-4;  // of light, squared: smallest difference of two targets
  if (spread < kApart) return {0, xx > 0 ? xy / xx : 1};
  const double contrast = (xy - x * y / count) / spread;
  return {(y - contrast * x) / count, contrast};
}

ColorSpread spread_of(const std::vector<FlatFieldMeasurements>& targets,
                      const std::vector<schemas::PhotometricResponse>& responses,
                      std::size_t reference) {
  ColorSpread spread;
  double sum = 0;
  int count = 0;
  for (const FlatFieldMeasurements& target : targets) {
    std::vector<schemas::Rgb> lights;
    schemas::Rgb mean{};
    const Lab expected = lab_from_linear(target_light(responses[reference], target[reference]));
    for (std::size_t c = 0; c < target.size(); ++c) {
      const schemas::Rgb& measured = lights.emplace_back(target_light(responses[c], target[c]));
      for (std::size_t k = 0; k < 3; ++k)
        mean[k] += measured[k] / static_cast<double>(target.size());
      if (c == reference) continue;
      const double difference = color_difference(expected, lab_from_linear(measured));
      sum += difference;
      ++count;
      spread.max_difference = std::max(spread.max_difference, difference);
    }
    // the relative deviation of a black target's means is meaningless
    constexpr double kBright = 0.02;
    for (std::size_t k = 0; k < 3; ++k) {
      if (mean[k] < kBright) continue;
      spread.deviation[k] = std::max(spread.deviation[k], relative_deviation(lights, k));
    }
  }
  spread.mean_difference = count > 0 ? sum / count : 0;
  return spread;
}

void judge(FlatFieldMatch& colors, const std::vector<FlatFieldMeasurements>& targets,
           const std::vector<std::string>& cameras) {
  constexpr double kClipped = 0.02, kUneven = 0.15, kPatterned = 0.35, kBright = 0.02;
  std::vector<std::string> clipped, uneven, patterned, dark;
  for (std::size_t c = 0; c < cameras.size(); ++c) {
    bool is_clipped = false, is_uneven = false;
    for (const FlatFieldMeasurements& target : targets) {
      is_clipped = is_clipped || target[c].clipped > kClipped;
      const double mean = target[c].mean[1];
      const bool is_evened = colors.responses[c].vignetting || colors.responses[c].gain_map;
      is_uneven =
          is_uneven || (!is_evened && mean > kBright && target[c].deviation[1] > kUneven * mean);
    }
    const FlatFieldMeasurement& brightest =
        std::ranges::max_element(targets, {}, [&](const auto& target) {
          return target[c].mean[1];
        })->at(c);
    const bool is_bright = brightest.mean[1] > kBright;
    const bool is_patterned = is_bright && brightest.deviation[1] > kPatterned * brightest.mean[1];
    if (!is_bright) dark.push_back(cameras[c]);
    if (is_patterned) patterned.push_back(cameras[c]);
    if (is_clipped) clipped.push_back(cameras[c]);
    if (is_uneven) uneven.push_back(cameras[c]);
  }
  add_sentence(colors.reasons, "A target is overexposed in ", clipped,
               ": reduce the exposure until white is below full scale.");
  add_sentence(colors.reasons, "No target is bright in ", dark,
               ": light the white target and expose for it.");
  add_sentence(colors.reasons, "The middle of the picture does not show a flat target in ",
               patterned, ": record takes of white, grey and lens caps.");
  constexpr double kDisagree = 0.05, kMore = 0.01;
  for (std::size_t k = 0; k < 3; ++k) {
    const double after = colors.after.deviation[k];
    if (after <= std::min(kDisagree, colors.before.deviation[k] + kMore)) continue;
    colors.reasons.push_back(fmt::format(
        "The means of the cameras still differ by {:.1f} %: contrast and brightness do not explain "
        "all differences. Non-linear cameras need a response curve from several exposures.",
        100 * after));
    break;
  }
  add_sentence(colors.warnings, "A target is unevenly lit in ", uneven,
               ": fill the middle of every picture with it, without shadows, or "
               "fit the vignetting if the lens is the cause.");
  constexpr double kUnevenCells = 0.02;  // residual without a gain map
  const bool is_lens_alone = !colors.responses.front().gain_map;
  if (is_lens_alone && colors.worst_vignetting > kUnevenCells) {
    colors.reasons.emplace_back(
        "The vignetting model does not explain the brightness of the target: fill every picture "
        "with it, evenly lit, or do not fit the vignetting.");
  }
  if (targets.size() < 2) {
    colors.warnings.emplace_back(
        "One target determines the contrast only: record lens caps or a grey target to determine "
        "the brightness.");
  }
}

constexpr double kDarker = 0.002;  // of full scale; above the noise
constexpr double kCutOff = 0.02;   // share of pixels at code 0 above which a mean is too large

/// Converts the reference camera's codes to light, per channel.
struct Scale {
  schemas::Rgb black{};  ///< measured without light
  schemas::Rgb factor{1, 1, 1};
};

/// Fits contrast and brightness of a camera whose vignetting is in `response`.
void match_camera(const std::vector<FlatFieldMeasurements>& targets, std::size_t camera,
                  std::size_t reference, const Scale& scale, const std::string& name,
                  schemas::PhotometricResponse& response) {
  const schemas::Rgb left = mean_centre_transmission(response, targets.front()[camera].size);
  for (std::size_t k = 0; k < 3; ++k) {
    std::vector<double> measured, expected;
    for (const FlatFieldMeasurements& target : targets) {
      if (std::max(target[camera].black[k], target[reference].black[k]) > kCutOff) continue;
      measured.push_back(target[camera].mean[k]);
      expected.push_back((target[reference].mean[k] - scale.black[k]) * scale.factor[k] * left[k]);
    }
    const Line line = measured.empty() ? Line{0, 0} : fitted(measured, expected);
    constexpr double kMin = 0.01, kMax = 100;
    if (!(line.contrast > kMin && line.contrast < kMax)) {
      throw Error::bad_input("camera \"" + name + "\" or the reference camera shows no light", "",
                             "Record a lit white target, in focus, with every camera");
    }
    response.contrast[k] = line.contrast;
    response.brightness[k] = line.brightness;
  }
}

/// Stores the hot pixels of the dark frames; rejects the match if a camera saw light.
void copy_dark_frame_results(const FlatFieldMeasurements& dark, std::size_t reference,
                             const std::vector<std::string>& cameras, FlatFieldMatch& colors) {
  std::vector<std::string> lit;
  for (std::size_t c = 0; c < cameras.size(); ++c) {
    const bool is_lit = std::ranges::max(dark[c].mean) > FlatFieldMeasurement::kDark ||
                        dark[c].hot_pixels.size() > schemas::PhotometricResponse::kMaxHotPixels;
    if (is_lit) {
      lit.push_back(cameras[c]);
    } else {
      colors.responses[c].hot_pixels = dark[c].hot_pixels;
    }
  }
  add_sentence(colors.reasons, "The dark target is not dark in ", lit, ": cap the lenses.");
  if (std::ranges::max(dark[reference].black) > kCutOff) {
    colors.warnings.emplace_back(
        "The reference camera's black level is clipped at code 0, so light may be too high: "
        "choose another reference camera.");
  }
}

std::vector<std::string> findings_of(const FlatFieldMatch& colors) {
  std::vector<std::string> findings;
  if (colors.responses.front().vignetting) {
    findings.push_back(
        fmt::format("Vignetting maximum residual unevenness of a target {:.2f} % (one sigma)",
                    100 * colors.worst_vignetting));
  }
  std::size_t dark = 0;
  for (const schemas::PhotometricResponse& response : colors.responses)
    dark += response.hot_pixels.size();
  if (dark > 0) {
    findings.push_back(fmt::format(
        "Hot pixels {}, including neighbours affected by JPEG compression; {:.1f} per camera", dark,
        static_cast<double>(dark) / colors.responses.size()));
  }
  return findings;
}

}  // namespace

FlatFieldMatch match_flat_fields(const std::vector<FlatFieldMeasurements>& targets,
                                 const std::vector<std::string>& cameras,
                                 const FlatFieldMatchOptions& options) {
  const auto reference = static_cast<std::size_t>(options.reference);
  const auto light_of = [&](const FlatFieldMeasurements& target) {
    return target[reference].mean[1];
  };
  const FlatFieldMeasurements& brightest = *std::ranges::max_element(targets, {}, light_of);
  const FlatFieldMeasurements& darkest = targets.back();  // with settings.dark
  FlatFieldMatch colors;
  colors.what = "targets";
  colors.responses = options.curves;
  colors.responses.resize(cameras.size());
  schemas::Rgb black{}, balance{1, 1, 1};
  for (std::size_t k = 0; options.dark && k < 3; ++k) {
    if (darkest[reference].black[k] <= kCutOff) black[k] = darkest[reference].mean[k];
  }
  if (options.neutral) {
    const schemas::Rgb& white = brightest[reference].mean;
    for (std::size_t k = 0; k < 3; ++k) balance[k] = (white[1] - black[1]) / (white[k] - black[k]);
  }
  // Vignetting depends on a camera's black level, and contrast on the vignetting.
  const int rounds = options.vignetting || options.flat_field ? 3 : 1;
  for (int round = 0; round < rounds; ++round) {
    Scale scale{black, balance};
    const schemas::Rgb left =
        mean_centre_transmission(colors.responses[reference], targets.front()[reference].size);
    for (std::size_t k = 0; k < 3; ++k) scale.factor[k] /= left[k];
    for (std::size_t c = 0; c < cameras.size(); ++c) {
      match_camera(targets, c, reference, scale, cameras[c], colors.responses[c]);
    }
    colors.worst_vignetting = 0;
    for (std::size_t c = 0; options.vignetting && c < cameras.size(); ++c) {
      const FlatFieldMeasurement& measurement = brightest[c];
      const VignettingFit found =
          fit_vignetting(measurement.cells, measurement.size, colors.responses[c]);
      colors.responses[c].vignetting = found.lens;
      colors.worst_vignetting = std::max(colors.worst_vignetting, found.residual);
    }
    for (std::size_t c = 0; options.flat_field && c < cameras.size(); ++c) {
      colors.responses[c].gain_map.reset();
      colors.responses[c].gain_map =
          fit_gain_map(brightest[c].cells, brightest[c].size, colors.responses[c], cameras[c]);
    }
  }
  if (options.dark) copy_dark_frame_results(darkest, reference, cameras, colors);
  if (options.dark &&
      light_of(*std::ranges::min_element(targets, {}, light_of)) < light_of(darkest) - kDarker) {
    colors.reasons.emplace_back(
        "A target is darker than the dark target: cap all lenses, including the reference "
        "camera's.");
  }
  colors.before =
      spread_of(targets, std::vector<schemas::PhotometricResponse>(cameras.size()), reference);
  colors.after = spread_of(targets, colors.responses, reference);
  judge(colors, targets, cameras);
  colors.findings = findings_of(colors);
  return colors;
}

}  // namespace raystage::calibrate
