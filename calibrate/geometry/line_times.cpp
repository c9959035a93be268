// SPDX-License-Identifier: Apache-2.0
// Decides about the line times of an array from their joint estimate: the common value of cameras
// with one frame size is the generalised least-squares mean, (1' C^-1 l) / (1' C^-1 1), and
// chi-squared of the differences from it determines whether cameras differ. Cost: cameras cubed.
#include "calibrate/geometry/line_times.h"

#include <fmt/format.h>

#include <Eigen/Dense>
#include <algorithm>
#include <array>
#include <cmath>
#include <map>
#include <utility>

#include "rig/row_times.h"

namespace raystage::calibrate {
namespace {

using Eigen::Index;
using Eigen::MatrixXd;
using Eigen::VectorXd;

/// The estimates of cameras with one frame size.
struct Group {
  std::vector<int> cameras;
  std::vector<Index> rows;  // in the covariance
};

std::vector<Group> groups_of_size(const ArrayModel& model, const TimeCorrection& correction) {
  std::map<std::pair<int, int>, Group> groups;
  for (std::size_t k = 0; k < correction.line_cameras.size(); ++k) {
    const int c = correction.line_cameras[k];
    Group& group = groups[{model.cameras[c].width, model.cameras[c].height}];
    group.cameras.push_back(c);
    group.rows.push_back(static_cast<Index>(k));
  }
  std::vector<Group> list;
  for (auto& [size, group] : groups) list.push_back(std::move(group));
  return list;
}

bool is_significant(double us, double deviation_us, int height) {
  return std::abs(us) > kMinLineTimeDeviations * deviation_us &&
         rig::read_out_ms(us, height) > kMinReadOutMs;
}

void choose(const ArrayModel& model, const std::vector<double>& used,
            const TimeCorrection& correction, const Group& group, LineTimes& result) {
  const auto count = static_cast<Index>(group.cameras.size());
  VectorXd total(count);
  MatrixXd covariance(count, count);
  for (Index a = 0; a < count; ++a) {
    const int c = group.cameras[static_cast<std::size_t>(a)];
    total[a] = used[c] + correction.line_time_us[c];
    for (Index b = 0; b < count; ++b) {
      covariance(a, b) = correction.line_covariance(group.rows[static_cast<std::size_t>(a)],
                                                    group.rows[static_cast<std::size_t>(b)]);
    }
  }
  const Eigen::LDLT<MatrixXd> solver(covariance);
  const VectorXd ones = VectorXd::Ones(count), weights = solver.solve(ones);
  const double information = weights.sum();
  const double common = weights.dot(total) / information;
  const VectorXd off = total - VectorXd::Constant(count, common);
  const double chi_squared = off.dot(solver.solve(off));
  const auto freedom = static_cast<double>(count - 1);
  // Four standard deviations of chi-squared, and a difference that matters.
  constexpr double kSigmas = 4, kMatters = 0.05;
  const double spread = std::sqrt(off.squaredNorm() / static_cast<double>(count));
  const bool differ = freedom > 0 && chi_squared > freedom + kSigmas * std::sqrt(2 * freedom) &&
                      spread > kMatters * std::abs(common);
  for (Index k = 0; k < count; ++k) {
    const int c = group.cameras[static_cast<std::size_t>(k)];
    LineTimes::Camera& camera = result.cameras[c];
    camera.estimate_us = differ ? total[k] : common;
    camera.deviation_us =
        std::sqrt(std::max(differ ? covariance(k, k) : 1 / std::max(information, 1e-300), 0.0));
    const bool is_rolling =
        is_significant(camera.estimate_us, camera.deviation_us, model.cameras[c].height);
    camera.us = is_rolling ? camera.estimate_us : 0;
    camera.source = !is_rolling ? LineTimes::Source::kInsignificant
                    : differ    ? LineTimes::Source::kFound
                                : LineTimes::Source::kFoundCommon;
  }
}

}  // namespace

bool LineTimes::is_any_found() const {
  return std::ranges::any_of(cameras, [](const Camera& camera) {
    return camera.source == Source::kFound || camera.source == Source::kFoundCommon;
  });
}

LineTimes choose_line_times(const ArrayModel& model, const std::vector<double>& used,
                            const std::vector<bool>& given, const TimeCorrection& correction) {
  LineTimes result;
  result.cameras.resize(model.cameras.size());
  for (std::size_t c = 0; c < used.size(); ++c) {
    if (given[c]) result.cameras[c] = {LineTimes::Source::kGiven, used[c], used[c], 0};
  }
  for (const Group& group : groups_of_size(model, correction)) {
    choose(model, used, correction, group, result);
  }
  return result;
}

std::string_view name_of(LineTimes::Source source) {
  constexpr std::array<std::string_view, 5> kNames{"none", "given", "found", "found in common",
                                                   "not significant"};
  return kNames[static_cast<std::size_t>(source)];
}

std::string format_line_times(const LineTimes& line_times, const ArrayModel& model) {
  using Source = LineTimes::Source;
  std::string text;
  const auto line = [&](Source source, const std::string& what) {
    int count = 0;
    double least = 0, most = 0, worst = 0, read_out = 0;
    for (std::size_t c = 0; c < line_times.cameras.size(); ++c) {
      const LineTimes::Camera& camera = line_times.cameras[c];
      if (camera.source != source) continue;
      least = count == 0 ? camera.estimate_us : std::min(least, camera.estimate_us);
      most = count == 0 ? camera.estimate_us : std::max(most, camera.estimate_us);
      worst = std::max(worst, camera.deviation_us);
      read_out = std::max(read_out, rig::read_out_ms(camera.estimate_us, model.cameras[c].height));
      ++count;
    }
    if (count == 0) return;
    text += text.empty() ? "Shutter    " : "           ";
    text += fmt::format("{} cameras: {}, line time {:.4g}", count, what, least);
    if (most != least) text += fmt::format(" to {:.4g}", most);
    if (worst > 0) text += fmt::format(" +- {:.2g}", worst);
    text += fmt::format(" us{}, read-out {:.3g} ms a frame\n", worst > 0 ? " (one sigma)" : "",
                        read_out);
  };
  line(Source::kGiven, "rolling, given");
  line(Source::kFoundCommon, "rolling, one value found");
  line(Source::kFound, "rolling, found for each");
  line(Source::kInsignificant, "global, as what was found is not significant");
  return text;
}

}  // namespace raystage::calibrate
