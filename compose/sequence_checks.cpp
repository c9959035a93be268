// SPDX-License-Identifier: Apache-2.0
#include "compose/sequence_checks.h"

#include <fmt/format.h>

#include <algorithm>
#include <cerrno>
#include <fstream>
#include <iterator>
#include <limits>
#include <set>
#include <vector>

#include "base/atomic_file.h"
#include "base/contained_path.h"
#include "compose/frame_range.h"
#include "compose/layers/view_coverage.h"
#include "compose/sequence_memory_plan.h"
#include "render/methods.h"
#include "schemas/rig_document.h"
#include "store/timeline_file.h"

namespace raystage::compose {

namespace {

/// Writes and removes a file. Throws Error if that fails.
void write_probe(const std::filesystem::path& path) {
  const TemporaryFile probe(path);
  errno = 0;
  std::ofstream file(probe.path());
  file << "probe" << std::flush;
  if (!file) throw Error::from_errno("cannot write a file", path.string(), "");
}

/// Reports unexpected effects of a focus pull.
void report_focus_pull(const ShotPlan& plan, const LightFieldLayer& light_field,
                       const SequenceOptions& options) {
  using Kind = schemas::ShotDocument::FocalPlane::Kind;
  const std::size_t layer = light_field.index();
  const Kind kind = plan.shot().layers[layer].focal_plane.kind;
  if (kind != Kind::kKeys && kind != Kind::kCamera) return;
  const render::Method& method = light_field.method();
  if (!method.uses_focal_plane()) {
    options.on_message(
        fmt::format("{}method {} estimates depth and ignores the focal plane: the focus pull has "
                    "no effect",
                    layer_label(plan, layer), method.name()));
  } else if (plan.shot().merge == schemas::ShotDocument::Merge::kDepth && plan.layers() > 1) {
    options.on_message(fmt::format(
        "{}the whole light field has the depth of its focal plane, and moves with it in "
        "front of and behind other layers",
        layer_label(plan, layer)));
  }
}

}  // namespace

void check_output_folder(const std::filesystem::path& folder) {
  create_folder(folder);
  // Permissions are not enough: a disk may be full or mounted read-only.
  try {
    write_probe(folder / "probe");
  } catch (const Error& error) {
    throw Error::failed("the output folder cannot be written to: " + error.what_happened(),
                        folder.string(), "Check its permissions and the free disk space");
  }
}

void check_disk_space(const std::filesystem::path& folder, const ShotPlan& plan, std::size_t frames,
                      const SequenceOptions& options) {
  std::error_code error;
  const std::filesystem::space_info space = std::filesystem::space(folder, error);
  if (error || space.available == std::numeric_limits<std::uintmax_t>::max()) return;
  const double raw = static_cast<double>(uncompressed_file_bytes(plan, options.deep)) * frames;
  // Lossless compression of images rarely exceeds a factor of four.
  const double least = plan.shot().output.compression == "none" ? raw : raw / 4;
  const double available = static_cast<double>(space.available);
  const std::string text =
      fmt::format("the disk has {} free, the {} frames need {} to {}", format_byte_size(available),
                  frames, format_byte_size(least), format_byte_size(raw));
  if (available < least)
    throw Error::failed(text, folder.string(), "Free disk space or choose another folder");
  if (available < raw) options.on_message("warning: " + text);
}

void check_existing_files(const SequenceName& name, std::span<const int> frames) {
  std::vector<int> existing;
  std::copy_if(frames.begin(), frames.end(), std::back_inserter(existing),
               [&](int frame) { return file_exists(name.path(frame)); });
  if (existing.empty()) return;
  throw Error::bad_input(fmt::format("{} of {} frames exist already ({})", existing.size(),
                                     frames.size(), format_frame_range(existing)),
                         name.pattern(),
                         "Choose to skip complete and current files, or to overwrite")
      .concerning({"existing"});
}

void check_plates_not_overwritten(const ShotPlan& plan, const SequenceName& name,
                                  const std::filesystem::path& shot_file) {
  const schemas::ShotDocument& shot = plan.shot();
  std::error_code ignored;
  const auto canonical = [&](const std::filesystem::path& path) {
    return std::filesystem::weakly_canonical(path, ignored);
  };
  for (std::size_t i = 0; i < plan.layers(); ++i) {
    if (plan.layer(i) == nullptr || !plan.layer(i)->input_file(shot.first_frame)) continue;
    std::set<std::filesystem::path> written;
    for (int frame = shot.first_frame; frame <= shot.last_frame; ++frame) {
      written.insert(canonical(name.path(frame)));
    }
    for (int frame = shot.first_frame; frame <= shot.last_frame; ++frame) {
      const std::filesystem::path file = *plan.layer(i)->input_file(frame);
      if (!plan.is_visible(i, frame) || !written.contains(canonical(file))) continue;
      throw Error::bad_input(fmt::format("frame {} shows {}, which this sequence would overwrite",
                                         frame, file.string()),
                             fmt::format("{}#/layers/{}/plate", shot_file.string(), i),
                             "Choose another output, or another plate")
          .concerning({"output"});
    }
  }
}

SequenceName checked_output_name(const SequenceOptions& options, std::size_t frames) {
  SequenceName name(options.output);
  if (frames > 1 && !name.has_frame_token()) {
    throw Error::bad_input(fmt::format("{} frames would all get the same name", frames),
                           options.output, "Write NAME.####.exr");
  }
  if (std::filesystem::path(options.output).extension() != ".exr") {
    throw Error::bad_input("the extension of the output is not .exr", options.output,
                           "Write NAME.####.exr");
  }
  return name;
}

void check_requested_aovs(const ShotPlan& plan, const std::filesystem::path& shot_file) {
  for (const LightFieldLayer* light_field : plan.light_fields()) {
    const render::Method& method = light_field->method();
    if (method.measures_coverage()) continue;
    throw Error::bad_input(
        "method " + std::string(method.name()) + " does not measure its coverage",
        fmt::format("{}#/layers/{}", shot_file.string(), light_field->index()),
        "Remove lf.cameras and lf.nearest from output.aovs, or choose another method")
        .concerning({"coverage"});
  }
}

void check_distributed_archives(const ShotPlan& plan, const std::filesystem::path& shot_file) {
  const auto refuse = [&](std::size_t layer, const char* member, const std::string& what) {
    throw Error::bad_input(what, fmt::format("{}#/layers/{}{}", shot_file.string(), layer, member),
                           "Gather the archives in one take (docs/farm.md lists what is supported "
                           "for several hosts)");
  };
  for (const LightFieldLayer* light_field : plan.light_fields()) {
    const std::size_t i = light_field->index();
    const render::Method& method = light_field->method();
    const render::DistributionMode mode = method.distribution(light_field->method_options());
    if (mode == render::DistributionMode::kNone) {
      refuse(i, "/method",
             fmt::format("method {} with these options cannot be rendered from archives on several "
                         "hosts",
                         method.name()));
    }
    if (plan.measures_coverage() && mode == render::DistributionMode::kLockstep) {
      refuse(i, "/method",
             fmt::format("the coverage of method {} cannot be measured from archives on several "
                         "hosts (lf.cameras, lf.nearest)",
                         method.name()));
    }
    if (light_field->matte()) {
      refuse(i, "/matte", "a layer with a matte cannot be rendered from archives on several hosts");
    }
    if (plan.is_light(i)) {
      refuse(i, "", "a light field that is used as a light cannot be on several hosts");
    }
  }
  if (plan.writes_aov("lf.confidence")) {
    throw Error::bad_input(
        "lf.confidence cannot be measured from archives on several hosts", shot_file.string(),
        "Remove lf.confidence from output.aovs, or gather the archives in one take")
        .concerning({"confidence"});
  }
}

void check_equirectangular_view(const ShotPlan& plan, const std::filesystem::path& shot_file) {
  if (!plan.shot_camera().is_equirectangular()) return;
  for (const LightFieldLayer* light_field : plan.light_fields()) {
    const std::string layer =
        fmt::format("{}#/layers/{}", shot_file.string(), light_field->index());
    if (light_field->reconstruction().fill != schemas::HoleFill::kNone) {
      throw Error::bad_input("holes of equirectangular views are not filled", layer, "Remove fill")
          .concerning({"fill"});
    }
    if (plan.hosts() != nullptr) {
      throw Error::bad_input("equirectangular views need the archives of all cameras on one host",
                             layer, "Gather the archives in one take");
    }
  }
  if (plan.writes_aov("motion")) {
    throw Error::bad_input("equirectangular views have no motion vectors", shot_file.string(),
                           "Remove motion from output.aovs");
  }
  if (plan.writes_aov("lf.confidence")) {
    throw Error::bad_input("lf.confidence is not measured for equirectangular views",
                           shot_file.string(), "Remove lf.confidence from output.aovs")
        .concerning({"confidence"});
  }
}

void check_deep_output(const ShotPlan& plan, const std::filesystem::path& shot_file) {
  std::size_t pictures = 0;  // layers around one volume count as one
  for (std::size_t i = plan.layers(); i > 0; i -= plan.volume_layer_count(i - 1)) ++pictures;
  if (pictures == 1 || plan.shot().merge == schemas::ShotDocument::Merge::kDepth) return;
  throw Error::bad_input(
      "deep files merge layers by depth, but this shot merges them in layer order",
      shot_file.string() + "#/merge", "Set merge to \"depth\", or write no deep files")
      .concerning({"deep"});
}

std::string layer_label(const ShotPlan& plan, std::size_t layer) {
  if (plan.layers() == 1) return "";
  const std::string& name = plan.shot().layers[layer].name;
  return name.empty() ? fmt::format("layer {}: ", layer)
                      : fmt::format("layer {} ({}): ", layer, name);
}

namespace {

/// Reports that meshes have no light of the shot.
void report_headlight(const ShotPlan& plan, const SequenceOptions& options) {
  if (!plan.shot().lights.empty()) return;
  for (std::size_t i = 0; i < plan.layers(); ++i) {
    if (plan.geometry(i) == nullptr) continue;
    options.on_message(
        "the shot has no lights: a headlight at the camera lights its meshes; add \"lights\"");
    return;
  }
}

/// Reports what of mesh files is not read (light, animations), and animations outside of the shot.
void report_mesh_losses(const ShotPlan& plan, const SequenceOptions& options) {
  for (std::size_t i = 0; i < plan.layers(); ++i) {
    const GeometryLayer* mesh = plan.geometry(i);
    if (mesh == nullptr) continue;
    const std::string& file = plan.shot().layers[i].geometry->file;
    if (mesh->has_unread_emission()) {
      options.on_message(
          fmt::format("warning: {}a material of {} emits light, which is not rendered: what only "
                      "emits is black",
                      layer_label(plan, i), file));
    }
    if (mesh->has_unread_animation()) {
      options.on_message(fmt::format(
          "warning: {}the animation of {} is not read or not read whole: only nodes of glTF move, "
          "not bones and morph targets, and nothing of other formats; export glTF with the motion "
          "baked to nodes, or write \"animated\": false",
          layer_label(plan, i), file));
    }
    const auto keys = mesh->key_frames();
    const schemas::ShotDocument& shot = plan.shot();
    if (!keys || ((*keys)[0] <= shot.last_frame && (*keys)[1] >= shot.first_frame)) continue;
    options.on_message(fmt::format(
        "warning: {}{} moves from frame {:.6g} to {:.6g}, the shot is {} to {}: the mesh "
        "stands still; add frame_offset",
        layer_label(plan, i), file, (*keys)[0], (*keys)[1], shot.first_frame, shot.last_frame));
  }
}

/// Reports frames that look where no camera of a layer's take looked, whatever is there.
void report_uncovered_rays(const ShotPlan& plan, const LightFieldLayer& light_field,
                           std::span<const PlannedFrame> frames, const SequenceOptions& options) {
  if (plan.shot_camera().is_equirectangular() || !light_field.is_transparent_where_unseen() ||
      !plan.shot().layers[light_field.index()].volume.empty()) {
    return;
  }
  constexpr std::size_t kMostFrames = 24;
  constexpr double kReportedShare = 0.02;
  const std::size_t step = (frames.size() + kMostFrames - 1) / kMostFrames;
  double most = 0;
  int worst = 0;
  for (std::size_t i = 0; i < frames.size(); i += step) {
    const int frame = frames[i].frame;
    if (!plan.is_visible(light_field.index(), frame)) continue;
    for (const Eye eye : plan.eyes()) {
      const double share = uncovered_ray_share(light_field.take().rig(), plan.camera(frame, eye),
                                               light_field.take().document().depth_range);
      if (share > most) worst = frame;
      most = std::max(most, share);
    }
  }
  if (most < kReportedShare) return;
  options.on_message(
      fmt::format("warning: {}the view looks where no camera looked: {:.0f} % of the rays of frame "
                  "{} have no data at any depth",
                  layer_label(plan, light_field.index()), 100 * most, worst));
}

}  // namespace

void report_sequence_warnings(const ShotPlan& plan, std::span<const PlannedFrame> frames,
                              const SequenceOptions& options) {
  if (const std::string& camera = plan.shot_camera().file_summary(); !camera.empty()) {
    options.on_message("camera: " + camera);
  }
  report_headlight(plan, options);
  report_mesh_losses(plan, options);
  for (const LightFieldLayer* light_field : plan.light_fields()) {
    const std::size_t i = light_field->index();
    const std::string of_layer = layer_label(plan, i);
    if (!exists(light_field->take().file(store::kTimelineFile))) {
      options.on_message(of_layer +
                         "the take has no timeline: its cameras agree, and their time stamps are "
                         "used as they are");
    }
    report_focus_pull(plan, *light_field, options);
    report_uncovered_rays(plan, *light_field, frames, options);
    if (!schemas::is_calibrated(schemas::read_rig(light_field->take().file("rig.json")))) {
      options.on_message(
          "warning: " + of_layer +
          "the rig is not calibrated: camera poses and lenses are guesses, and the frames have "
          "the same errors");
    }
    const auto held = std::ranges::count_if(
        frames, [&](const PlannedFrame& frame) { return frame.shown[i].held; });
    const auto black = std::ranges::count_if(frames, [&](const PlannedFrame& frame) {
      return plan.is_visible(i, frame.frame) && !frame.shown[i].tick;
    });
    if (held > 0) {
      options.on_message(fmt::format("{}{} frames show the nearest instant of the take that exists",
                                     of_layer, held));
    }
    if (black > 0) {
      options.on_message(
          fmt::format("{}{} frames are empty: the take has no instant for them", of_layer, black));
    }
  }
}

}  // namespace raystage::compose
