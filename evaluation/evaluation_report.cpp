// SPDX-License-Identifier: Apache-2.0
#include <fmt/format.h>

#include <cmath>

#include "evaluation/evaluation.h"
#include "evaluation/report_json.h"
#include "schemas/former_names.h"
#include "schemas/json_text.h"

namespace raystage::evaluation {
namespace {

nlohmann::ordered_json as_json(const PictureErrors& errors) {
  return {{"psnr_db", json_number(errors.psnr_db)},
          {"ms_ssim", json_number(errors.ms_ssim)},
          {"share", json_number(errors.share)}};
}

nlohmann::ordered_json as_json(const RegionErrors& errors) {
  return {{"edge_band", as_json(errors.edge_band)},
          {"thin", as_json(errors.thin)},
          {"bad_depths_half_px", json_number(errors.bad_depths_half_px)},
          {"bad_depths_1_px", json_number(errors.bad_depths_1_px)},
          {"plane_rms_px", json_number(errors.plane_rms_px)},
          {"edge_alpha", json_number(errors.edge_alpha)},
          {"edge_alpha_gradient", json_number(errors.edge_alpha_gradient)}};
}

nlohmann::ordered_json as_json(const LightErrors& errors) {
  return {{"pu_psnr_db", json_number(errors.pu_psnr_db)},
          {"highlight_share", json_number(errors.highlight_share)},
          {"highlight_rms_stops", json_number(errors.highlight_rms_stops)}};
}

nlohmann::ordered_json as_json(const ViewEvaluation& view) {
  nlohmann::ordered_json json{{"id", view.id},
                              {"psnr_db", json_number(view.quality.psnr_db)},
                              {"ssim", json_number(view.quality.ssim)},
                              {"coverage", view.quality.covered},
                              {"decode_ms", view.decode_ms},
                              {"render_ms", view.render_ms},
                              {"working_mb", view.working_mb},
                              {"decoded_per_needed", json_number(view.decoded_per_needed)}};
  if (view.regions) json["regions"] = as_json(*view.regions);
  if (view.light) json["light"] = as_json(*view.light);
  return json;
}

std::string ratio_as_text(double ratio) {
  return std::isnan(ratio) ? "-" : fmt::format("{:.3f}", ratio);
}

}  // namespace

std::string evaluation_as_json(const Evaluation& evaluation) {
  nlohmann::ordered_json document{{"schema", "raystage/evaluation/1"},
                                  {"take", evaluation.take},
                                  {"method", evaluation.method},
                                  {"options", json_options(evaluation.options)},
                                  {"focal_depth_m", json_number(evaluation.focal_depth)},
                                  {"exact_times", evaluation.exact_times},
                                  {"cameras", evaluation.cameras},
                                  {"notes", evaluation.notes},
                                  {"mean", as_json(evaluation.mean)}};
  document["mean"].erase("id");
  document["temporal_stability"] = {
      {"psnr_stddev_db", evaluation.temporal_stability.stddev_db},
      {"psnr_max_step_db", evaluation.temporal_stability.max_step_db}};
  document["shots"] = nlohmann::ordered_json::array();
  for (const ShotStability& shot : evaluation.shots) {
    document["shots"].push_back(
        {{"id", shot.id},
         {"views", shot.views},
         {"error_variance", json_number(shot.error_variance)},
         {"edge_band_error_variance", json_number(shot.edge_band_error_variance)},
         {"mean_square_error", json_number(shot.mean_square_error)}});
  }
  document["views"] = nlohmann::ordered_json::array();
  for (const ViewEvaluation& view : evaluation.views) document["views"].push_back(as_json(view));
  constexpr schemas::FormerName kFormerNames[] = {{"coverage", "covered"},
                                                  {"temporal_stability", "steadiness"},
                                                  {"psnr_stddev_db", "psnr_deviation_db"},
                                                  {"psnr_max_step_db", "psnr_largest_step_db"}};
  schemas::add_former_names(document, kFormerNames);
  return schemas::dump_json(document) + "\n";
}

std::string evaluation_as_text(const Evaluation& evaluation) {
  std::string text = fmt::format("{}: {}, focal plane {:.4g} m, {} cameras\n", evaluation.take,
                                 evaluation.method, evaluation.focal_depth, evaluation.cameras);
  text += fmt::format("{:<20} {:>8} {:>7} {:>8} {:>10} {:>10} {:>15}\n", "view", "PSNR dB", "SSIM",
                      "covered", "decode ms", "render ms", "decoded/needed");
  const auto add = [&](const ViewEvaluation& view) {
    text += fmt::format("{:<20} {:>8.2f} {:>7.4f} {:>7.1f}% {:>10.2f} {:>10.2f} {:>15}\n", view.id,
                        view.quality.psnr_db, view.quality.ssim, view.quality.covered * 100,
                        view.decode_ms, view.render_ms, ratio_as_text(view.decoded_per_needed));
  };
  for (const ViewEvaluation& view : evaluation.views) add(view);
  add(evaluation.mean);
  if (const auto& light = evaluation.mean.light) {
    text += fmt::format("linear light, not clipped at white: {:.2f} dB (PU21)", light->pu_psnr_db);
    if (std::isfinite(light->highlight_rms_stops)) {
      text += fmt::format("; above white ({:.2f} % of the pixels): {:.2f} stops RMS",
                          100 * light->highlight_share, light->highlight_rms_stops);
    }
    text += '\n';
  }
  if (const auto& regions = evaluation.mean.regions) {
    text += fmt::format(
        "edges of depth (8 px): {:.2f} dB, MS-SSIM {:.4f}; thin structures: {:.2f} dB, MS-SSIM "
        "{:.4f}\n"
        "depths wrong by more than 0.5 px of disparity: {:.2f} %, 1 px: {:.2f} %; on planes: "
        "{:.3f} "
        "px RMS\n",
        regions->edge_band.psnr_db, regions->edge_band.ms_ssim, regions->thin.psnr_db,
        regions->thin.ms_ssim, 100 * regions->bad_depths_half_px, 100 * regions->bad_depths_1_px,
        regions->plane_rms_px);
    if (std::isfinite(regions->edge_alpha)) {
      text += fmt::format(
          "alpha of pixels with two surfaces: mean error {:.3f}, of its gradient {:.3f}\n",
          regions->edge_alpha, regions->edge_alpha_gradient);
    }
  }
  if (evaluation.views.size() > 1) {
    text += fmt::format(
        "PSNR: standard deviation {:.2f} dB, largest step between views of a shot {:.2f} dB\n",
        evaluation.temporal_stability.stddev_db, evaluation.temporal_stability.max_step_db);
  }
  for (const ShotStability& shot : evaluation.shots) {
    text += fmt::format(
        "shot {} ({} views): temporal variance of the error {:.2f}, mean square error {:.2f} "
        "(squared 8-bit codes)\n",
        shot.id, shot.views, shot.error_variance, shot.mean_square_error);
    if (std::isfinite(shot.edge_band_error_variance)) {
      text += fmt::format("shot {}: temporal variance of the error at edges of depth {:.2f}\n",
                          shot.id, shot.edge_band_error_variance);
    }
  }
  for (const std::string& note : evaluation.notes) text += "note: " + note + "\n";
  return text;
}

std::string evaluation_table_heading() {
  return "| setting | cameras | focal plane m | PSNR dB | SSIM | covered % | decode ms | render ms "
         "| "
         "decoded/needed |\n| --- | --: | --: | --: | --: | --: | --: | --: | --: |\n";
}

std::string evaluation_table_row(const Evaluation& evaluation, const std::string& label) {
  const ViewEvaluation& mean = evaluation.mean;
  return fmt::format("| {} | {} | {:.4g} | {:.2f} | {:.4f} | {:.1f} | {:.1f} | {:.1f} | {} |\n",
                     label, evaluation.cameras, evaluation.focal_depth, mean.quality.psnr_db,
                     mean.quality.ssim, mean.quality.covered * 100, mean.decode_ms, mean.render_ms,
                     ratio_as_text(mean.decoded_per_needed));
}

}  // namespace raystage::evaluation
