// SPDX-License-Identifier: Apache-2.0
#include "calibrate/flat_target.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>

#include "calibrate/color_difference.h"
#include "rig/calibration/verdict.h"
#include "schemas/error.h"
#include "schemas/parallel.h"
#include "store/code_light.h"
#include "store/jpeg/decode.h"

namespace raystage {
namespace {

constexpr int kFullCode = 252;  // codes: JPEG leaves clipped areas a little below 255

/// Shown by the reference = brightness + contrast * shown, of one channel.
struct Line {
  double brightness = 0, contrast = 1;
};

Line fitted(const std::vector<double>& shown, const std::vector<double>& reference) {
  const auto count = static_cast<double>(shown.size());
  double x = 0, y = 0, xx = 0, xy = 0;
  for (std::size_t i = 0; i < shown.size(); ++i) {
    x += shown[i];
    y += reference[i];
    xx += shown[i] * shown[i];
    xy += shown[i] * reference[i];
  }
  const double spread = xx - x * x / count;
  constexpr double kApart = 1e-4;  // of light, squared: two targets that differ
  if (spread < kApart) return {0, xx > 0 ? xy / xx : 1};
  const double contrast = (xy - x * y / count) / spread;
  return {(y - contrast * x) / count, contrast};
}

ColorSpread spread_of(const std::vector<FlatSights>& targets,
                      const std::vector<PhotometricResponse>& responses, std::size_t reference) {
  ColorSpread spread;
  double sum = 0;
  int count = 0;
  for (const FlatSights& target : targets) {
    Rgb mean{}, squares{};
    const Lab expected = lab_from_linear(corrected(responses[reference], target[reference].mean));
    for (std::size_t c = 0; c < target.size(); ++c) {
      const Rgb shown = corrected(responses[c], target[c].mean);
      for (std::size_t k = 0; k < 3; ++k) {
        mean[k] += shown[k] / static_cast<double>(target.size());
        squares[k] += shown[k] * shown[k] / static_cast<double>(target.size());
      }
      if (c == reference) continue;
      const double difference = color_difference(expected, lab_from_linear(shown));
      sum += difference;
      ++count;
      spread.most_difference = std::max(spread.most_difference, difference);
    }
    constexpr double kBright = 0.02;  // of a black target's means the spread by them says nothing
    for (std::size_t k = 0; k < 3; ++k) {
      if (mean[k] < kBright) continue;
      const double deviation = std::sqrt(std::max(0.0, squares[k] - mean[k] * mean[k])) / mean[k];
      spread.deviation[k] = std::max(spread.deviation[k], deviation);
    }
  }
  spread.mean_difference = count > 0 ? sum / count : 0;
  return spread;
}

void judge(FlatColors& colors, const std::vector<FlatSights>& targets,
           const std::vector<std::string>& cameras) {
  constexpr double kClipped = 0.02, kUneven = 0.15, kBright = 0.02;
  std::vector<std::string> clipped, uneven;
  for (std::size_t c = 0; c < cameras.size(); ++c) {
    bool is_clipped = false, is_uneven = false;
    for (const FlatSights& target : targets) {
      is_clipped = is_clipped || target[c].clipped > kClipped;
      const double mean = target[c].mean[1];
      is_uneven = is_uneven || (mean > kBright && target[c].deviation[1] > kUneven * mean);
    }
    if (is_clipped) clipped.push_back(cameras[c]);
    if (is_uneven) uneven.push_back(cameras[c]);
  }
  if (!clipped.empty()) {
    colors.reasons.push_back("A target is overexposed in " + few_of(clipped) +
                             ": expose less, so that white stays below full scale.");
  }
  if (!uneven.empty()) {
    colors.warnings.push_back("A target is not everywhere as bright in " + few_of(uneven) +
                              ": let it fill the middle of every picture, without shadows.");
  }
  if (targets.size() < 2) {
    colors.warnings.emplace_back(
        "One target tells the contrast alone: with lens caps or a grey target the brightness, "
        "too.");
  }
}

}  // namespace

Rgb corrected(const PhotometricResponse& response, const Rgb& shown) {
  Rgb light{};
  for (std::size_t k = 0; k < 3; ++k) {
    light[k] = response.brightness[k] + response.contrast[k] * shown[k];
  }
  return light;
}

FlatSight flat_sight(const Take& take, int camera, double share, int most_frames) {
  const ArchiveReader& archive = take.archive(camera);
  const auto frames = static_cast<int>(archive.frames().size());
  const std::string& id = take.document().cameras[static_cast<std::size_t>(camera)].id;
  if (frames == 0) {
    throw Error::bad_input("camera \"" + id + "\" has no frames", take.folder().string(),
                           "Record the target with every camera");
  }
  std::array<double, 256> light{};
  for (int code = 0; code < 256; ++code) {
    light[static_cast<std::size_t>(code)] = linear_of_code(take.document(), code);
  }
  JpegDecoder decoder;
  FlatSight sight;
  Rgb squares{};
  double count = 0, clipped = 0;
  const int looked_at = std::min(frames, most_frames);
  for (int k = 0; k < looked_at; ++k) {
    const RgbImage image = decoder.decode(archive.jpeg((2 * k + 1) * frames / (2 * looked_at)), id);
    const int left = static_cast<int>(image.width * (1 - share) / 2);
    const int top = static_cast<int>(image.height * (1 - share) / 2);
    for (int y = top; y < image.height - top; ++y) {
      for (int x = left; x < image.width - left; ++x) {
        const std::uint8_t* rgb =
            &image.pixels[3 * (static_cast<std::size_t>(y) * static_cast<std::size_t>(image.width) +
                               static_cast<std::size_t>(x))];
        for (std::size_t c = 0; c < 3; ++c) {
          const double value = light[rgb[c]];
          sight.mean[c] += value;
          squares[c] += value * value;
          sight.black[c] += rgb[c] == 0 ? 1 : 0;
        }
        clipped += std::max({rgb[0], rgb[1], rgb[2]}) >= kFullCode ? 1 : 0;
        count += 1;
      }
    }
  }
  for (std::size_t c = 0; c < 3; ++c) {
    sight.mean[c] /= count;
    sight.black[c] /= count;
    sight.deviation[c] =
        std::sqrt(std::max(0.0, squares[c] / count - sight.mean[c] * sight.mean[c]));
  }
  sight.clipped = clipped / count;
  return sight;
}

FlatSights flat_sights(const Take& take, const std::stop_token& stop) {
  FlatSights sights(static_cast<std::size_t>(take.camera_count()));
  parallel_for(0, take.camera_count(), [&](int camera) {
    if (stop.stop_requested()) {
      throw Error::failed("the measurement was stopped", take.folder().string(), "Start it again");
    }
    sights[static_cast<std::size_t>(camera)] = flat_sight(take, camera);
  });
  return sights;
}

FlatColors match_flat_targets(const std::vector<FlatSights>& targets,
                              const std::vector<std::string>& cameras,
                              const FlatColorSettings& settings) {
  const auto reference = static_cast<std::size_t>(settings.reference);
  FlatColors colors;
  Rgb white{1, 1, 1};  // that the reference shows of the brightest target
  const auto brightest = std::ranges::max_element(
      targets, {}, [&](const FlatSights& target) { return target[reference].mean[1]; });
  if (settings.neutral) white = (*brightest)[reference].mean;
  for (std::size_t c = 0; c < cameras.size(); ++c) {
    PhotometricResponse response;
    for (std::size_t k = 0; k < 3; ++k) {
      std::vector<double> shown, expected;
      for (const FlatSights& target : targets) {
        constexpr double kCutOff = 0.02;
        if (std::max(target[c].black[k], target[reference].black[k]) > kCutOff) continue;
        shown.push_back(target[c].mean[k]);
        expected.push_back(target[reference].mean[k] * white[1] / white[k]);
      }
      const Line line = shown.empty() ? Line{0, 0} : fitted(shown, expected);
      constexpr double kLeast = 0.01, kMost = 100;
      if (!(line.contrast > kLeast && line.contrast < kMost)) {
        throw Error::bad_input(
            "camera \"" + cameras[c] + "\" or the reference camera shows no light", "",
            "Record a white target with every camera, lit and in focus");
      }
      response.contrast[k] = line.contrast;
      response.brightness[k] = line.brightness;
    }
    colors.responses.push_back(response);
  }
  colors.before = spread_of(targets, std::vector<PhotometricResponse>(cameras.size()), reference);
  colors.after = spread_of(targets, colors.responses, reference);
  judge(colors, targets, cameras);
  return colors;
}

std::string color_text(const FlatColors& colors, const std::string& reference) {
  const auto line = [](const char* when, const ColorSpread& spread) {
    return fmt::format(
        "{:<10} cameras' means differ by {:.2f} % in red, {:.2f} in green, {:.2f} in blue (one "
        "sigma); CIEDE2000 {:.2f} in the mean, {:.2f} at most\n",
        when, 100 * spread.deviation[0], 100 * spread.deviation[1], 100 * spread.deviation[2],
        spread.mean_difference, spread.most_difference);
  };
  std::string text = fmt::format("Reference  {}\n", reference);
  text += line("Before", colors.before) + line("After", colors.after);
  for (const std::string& warning : colors.warnings) text += "Weak       " + warning + "\n";
  for (const std::string& reason : colors.reasons) text += "Not sure   " + reason + "\n";
  return text;
}

}  // namespace raystage
