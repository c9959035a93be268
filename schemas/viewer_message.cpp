// SPDX-License-Identifier: Apache-2.0
#include "schemas/viewer_message.h"

#include <fmt/format.h>

#include <cmath>

#include "schemas/fields.h"
#include "schemas/json_text.h"

namespace raystage::schemas {
namespace {

using Camera = ViewerMessage::Camera;
using Look = ViewerMessage::Look;
using Type = ViewerMessage::Type;

constexpr Fields kCamera(required("position", &Camera::position),
                         required("orientation", &Camera::orientation),
                         required("focal_length_mm", &Camera::focal_length_mm),
                         required("film_back_mm", &Camera::film_back_mm),
                         optional("shift_x", &Camera::shift_x),
                         optional("shift_y", &Camera::shift_y),
                         optional("focus_m", &Camera::focus_m),
                         optional("f_number", &Camera::f_number));

constexpr auto kChannels =
    enum_names<Look::Channel>("color", "alpha", "depth", "coverage", "confidence");
constexpr Fields kLook(optional("channel", &Look::channel, kChannels),
                       optional("exposure", &Look::exposure), optional("display", &Look::display),
                       optional("view", &Look::view), optional("black", &Look::black),
                       optional("peaking", &Look::peaking));

constexpr Fields kComparison(optional("text", &ViewerMessage::Comparison::text),
                             optional("file", &ViewerMessage::Comparison::file, kPath),
                             optional("sequence", &ViewerMessage::Comparison::sequence, kPath));

constexpr Fields kSubject(required("point", &ViewerMessage::Subject::point),
                          required("size_m", &ViewerMessage::Subject::size_m));

constexpr auto kTypes = enum_names<Type>(
    "view", "shot", "focus", "probe", "open", "save", "snapshot", "export", "autosave", "notes",
    "cancel", "mosaic", "source", "epi", "folder", "thumbnail", "live", "keys");
constexpr auto kArrangements =
    enum_names<ViewerMessage::Arrangement>("single", "side_by_side", "anaglyph", "quilt");
constexpr auto kEyes = enum_names<ViewerMessage::Eye>("both", "left", "right");
constexpr auto kQualities = enum_names<ViewerMessage::Quality>("moving", "playing", "resting");

/// Returns the properties that a type of message needs.
std::vector<std::string_view> needed_by(Type type) {
  switch (type) {
    case Type::kView:
      return {"frame", "width", "height"};
    case Type::kShot:
      return {"file", "text"};
    case Type::kFocus:
    case Type::kProbe:
    case Type::kEpi:
      return {"frame", "width", "height", "pixel"};
    case Type::kOpen:
    case Type::kExport:
    case Type::kAutosave:
    case Type::kFolder:
      return {"file"};
    case Type::kSave:
    case Type::kNotes:
      return {"file", "text"};
    case Type::kSnapshot:
      return {"frame", "file"};
    case Type::kCancel:
    case Type::kKeys:
      return {};
    case Type::kMosaic:
      return {"frame", "width", "height"};
    case Type::kSource:
      return {"frame", "width", "height", "camera_id"};
    case Type::kThumbnail:
    case Type::kLive:
      return {"file", "width", "height"};
  }
  return {};
}

void check_type(const JsonNode& object, const ViewerMessage& message) {
  for (const std::string_view property : needed_by(message.type)) {
    if (object.has(property)) continue;
    throw object.input_error(fmt::format("the property \"{}\" is missing", property),
                             "Add what this type of message needs");
  }
}

/// Bounds the memory of a picture: a wall of 5120x2880 is below.
void check_size(const JsonNode& object, const ViewerMessage& message) {
  constexpr double kMaxPixels = 1 << 24;
  if (static_cast<double>(message.width) * message.height <= kMaxPixels) return;
  throw object.input_error(fmt::format("found a picture of {}x{}, allowed: at most 2^24 pixels",
                                       message.width, message.height),
                           "Request a smaller picture");
}

void check_orientation(const JsonNode& object, const ViewerMessage& message) {
  if (!message.camera) return;
  double square = 0;
  for (const double value : message.camera->orientation) square += value * value;
  constexpr double kTolerance = 1e-6;  // of browsers' arithmetic
  if (std::abs(square - 1) <= kTolerance) return;
  throw object.at("camera")
      .at("orientation")
      .input_error("found a quaternion that is not a unit", "Divide it by its length");
}

void check_comparison(const JsonNode& object, const ViewerMessage& message) {
  if (!message.comparison) return;
  const ViewerMessage::Comparison& with = *message.comparison;
  const int given = !with.text.empty() + !with.file.empty() + !with.sequence.empty();
  if (given == 1) return;
  throw object.at("comparison")
      .input_error(fmt::format("found {} of text, file and sequence, allowed: 1", given),
                   "State what to compare with");
}

constexpr Fields kMessage(
    required("type", &ViewerMessage::type, kTypes), required("id", &ViewerMessage::id),
    defaulted("frame", &ViewerMessage::frame), optional("camera", &ViewerMessage::camera, kCamera),
    optional("width", &ViewerMessage::width), optional("height", &ViewerMessage::height),
    optional("eye", &ViewerMessage::eye, kEyes),
    optional("arrangement", &ViewerMessage::arrangement, kArrangements),
    optional("comparison", &ViewerMessage::comparison, kComparison),
    optional("subject", &ViewerMessage::subject, kSubject),
    defaulted("quality", &ViewerMessage::quality, kQualities),
    optional("look", &ViewerMessage::look, kLook), defaulted("pixel", &ViewerMessage::pixel),
    optional("layer", &ViewerMessage::layer), optional("camera_id", &ViewerMessage::camera_id),
    optional("mosaic", &ViewerMessage::mosaic), optional("file", &ViewerMessage::file, kPath),
    optional("text", &ViewerMessage::text), optional("shot", &ViewerMessage::shot, kPath),
    optional("previous", &ViewerMessage::previous), optional("replace", &ViewerMessage::replace),
    check(check_type), check(check_size), check(check_orientation), check(check_comparison));

}  // namespace

std::optional<std::int64_t> find_viewer_message_id(std::string_view text) {
  constexpr std::int64_t kMaxId = 9'007'199'254'740'991;  // exact in JavaScript
  try {
    const nlohmann::json json = parse_json(text, "");
    if (!json.is_object() || !json.contains("id")) return std::nullopt;
    const nlohmann::json& id = json["id"];
    if (!id.is_number_unsigned() || id.get<std::uint64_t>() > kMaxId) return std::nullopt;
    return id.get<std::int64_t>();
  } catch (const Error&) {
    return std::nullopt;
  }
}

ViewerMessage parse_viewer_message(std::string_view text, std::string_view name) {
  return parse_document_as<ViewerMessage>("viewer_message", kMessage, text, name);
}

std::string format_viewer_message(const ViewerMessage& message) {
  return format_document("viewer_message", kMessage, message);
}

}  // namespace raystage::schemas
