// SPDX-License-Identifier: Apache-2.0
// The built-in config is applied by OpenColorIO in this process. For a given one
// raystage-apply-ocio does it, except for matrices: they are applied here. Cost: linear in pixels.
#include "compose/color/color_config.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <cstring>
#include <mutex>
#include <optional>

#include "base/error.h"
#include "compose/color/color_requests.h"
#include "compose/color/ocio_config.h"
#include "sandbox/answer.h"
#include "sandbox/decoder_pool.h"

namespace raystage::compose {
namespace {

constexpr const char* kKind = "colour config";

sandbox::DecoderOptions color_decoder_options() {
  sandbox::DecoderOptions options;
  options.program = "raystage-apply-ocio";
  options.kind = kKind;
  options.advice = "Give a valid OpenColorIO config (.ocio)";
  options.memory_bytes = std::size_t{2} << 30;  // tables of up to 1 GiB
  options.time = std::chrono::seconds(20);
  options.environment = sandbox::Environment::kInherited;  // contexts of configs
  return options;
}

/// A config that confined processes read.
struct GivenConfig {
  std::filesystem::path file;
  std::string rec709_name, description;
  sandbox::DecoderPool decoders{color_decoder_options()};
  mutable std::mutex mutex;
  /// A file outside of the config's folder, which was refused. OpenColorIO asks once for each.
  mutable std::string outside;

  GivenConfig(std::filesystem::path of_file, std::string name_of_rec709)
      : file(std::move(of_file)), rec709_name(std::move(name_of_rec709)) {}

  ColorRequest request(ColorQuestion question) const {
    return {.question = question, .file = file.string(), .rec709_name = rec709_name, .names = {}};
  }
  std::vector<std::byte> decode(std::span<const std::byte> bytes) const {
    constexpr std::uint64_t kMaxBytes = std::uint64_t{1} << 30;  // of a file
    const auto open =
        [&, permitted = sandbox::files_below_folder_of(file, kMaxBytes)](const std::string& name) {
          if (is_file_outside(name)) {
            const std::scoped_lock lock(mutex);
            outside = name;
          }
          return permitted(name);
        };
    return decoders.decode(bytes, file, open);
  }
  template <class Read>
  auto ask(const ColorRequest& asked, const Read& read) const {
    sandbox::ByteWriter writer;
    write_request(writer, asked);
    try {
      // Errors of the config's contents name it as they would in this process.
      return sandbox::read_answer(decode(writer.take()), kKind,
                                  description.empty() ? file : std::filesystem::path(description),
                                  read);
    } catch (const Error&) {
      const std::scoped_lock lock(mutex);
      if (outside.empty()) throw;
      throw Error::bad_input("the colour config reads a file outside of its folder, " + outside,
                             file.string(),
                             "Copy that file below the folder of the config, and name it there");
    }
  }
  bool is_file_outside(const std::filesystem::path& name) const {
    std::error_code unknown;
    const std::filesystem::path folder = std::filesystem::absolute(file, unknown).parent_path();
    const std::filesystem::path way = std::filesystem::absolute(name, unknown)
                                          .lexically_normal()
                                          .lexically_relative(folder.lexically_normal());
    return !way.empty() && *way.begin() == ".." && std::filesystem::is_regular_file(name, unknown);
  }
  std::string text(const ColorRequest& asked) const {
    return ask(asked, [](sandbox::ByteReader& reader) {
      std::string text;
      reader.read_plain(text);
      return text;
    });
  }
};

}  // namespace

struct ColorTransform::State {
  bool is_linear = false, is_no_op = false;

  State() = default;
  State(const State&) = delete;
  State& operator=(const State&) = delete;
  virtual ~State() = default;
  virtual void apply(std::span<float> values, int channels) const = 0;
};

namespace {

struct BuiltInTransform final : ColorTransform::State {
  OcioTransform transform;

  explicit BuiltInTransform(OcioTransform of_config) : transform(std::move(of_config)) {
    is_linear = transform.is_linear();
    is_no_op = transform.is_no_op();
  }
  void apply(std::span<float> values, int channels) const override {
    transform.apply(values, channels);
  }
};

struct GivenTransform final : ColorTransform::State {
  std::shared_ptr<const GivenConfig> config;
  ColorRequest request;
  TransformProperties properties;

  GivenTransform(std::shared_ptr<const GivenConfig> of_config, TransformKind kind,
                 std::array<std::string, 3> names)
      : config(std::move(of_config)), request(config->request(ColorQuestion::kProperties)) {
    request.kind = kind;
    request.names = std::move(names);
    config->ask(request, [this](sandbox::ByteReader& reader) {
      properties.is_no_op = reader.read_flag();
      properties.is_linear = reader.read_flag();
      properties.is_matrix = reader.read_flag();
      reader.read(properties.columns);
      for (const auto& column : properties.columns) {
        sandbox::ByteReader::require(
            !(properties.is_linear || properties.is_matrix) ||
            std::ranges::all_of(column, [](float value) { return std::isfinite(value); }));
      }
      return true;
    });
    is_linear = properties.is_linear;
    is_no_op = properties.is_no_op;
    request.question = ColorQuestion::kApply;
  }

  void apply(std::span<float> values, int channels) const override {
    const auto step = static_cast<std::size_t>(channels);
    if (properties.is_matrix) {
      const auto& [r, g, b] = properties.columns;
      for (std::size_t i = 0; i + 2 < values.size(); i += step) {
        const std::array<float, 3> rgb{values[i], values[i + 1], values[i + 2]};
        for (std::size_t c = 0; c < 3; ++c) {
          values[i + c] = rgb[0] * r[c] + rgb[1] * g[c] + rgb[2] * b[c];
        }
      }
      return;
    }
    constexpr std::size_t kPixels = 1 << 20;  // at once, to bound the memory
    while (!values.empty()) {
      const std::span<float> part = values.first(std::min(values.size(), kPixels * step));
      apply_part(part, channels);
      values = values.subspan(part.size());
    }
  }

 private:
  void apply_part(std::span<float> values, int channels) const {
    sandbox::ByteWriter writer;
    write_request(writer, request);
    writer.write(channels);
    writer.write_plain(values);
    sandbox::read_answer(config->decode(writer.take()), kKind, config->file,
                         [&](sandbox::ByteReader& reader) {
                           const auto bytes = reader.read_rest();
                           sandbox::ByteReader::require(bytes.size() == values.size_bytes());
                           std::memcpy(values.data(), bytes.data(), bytes.size());
                           return true;
                         });
  }
};

}  // namespace

void ColorTransform::apply(std::span<float> rgba) const {
  if (state_->is_no_op || rgba.empty()) return;
  const bool divide = !state_->is_linear;
  const auto scale = [&](bool back) {
    for (std::size_t i = 0; divide && i < rgba.size(); i += 4) {
      const float alpha = rgba[i + 3];
      if (!(alpha > 0) || alpha == 1) continue;
      for (std::size_t c = 0; c < 3; ++c) rgba[i + c] *= back ? alpha : 1 / alpha;
    }
  };
  scale(false);
  state_->apply(rgba, 4);
  scale(true);
}

void ColorTransform::apply_rgb(std::span<float> rgb) const {
  if (state_->is_no_op || rgb.empty()) return;
  state_->apply(rgb, 3);
}

bool ColorTransform::is_linear() const { return state_->is_linear; }
bool ColorTransform::is_no_op() const { return state_->is_no_op; }

struct ColorConfig::State {
  std::optional<OcioConfig> built_in;
  std::shared_ptr<const GivenConfig> given;  ///< null: the built-in one

  ColorTransform transform(TransformKind kind, std::array<std::string, 3> names) const {
    if (given) {
      return ColorTransform(std::make_shared<const GivenTransform>(given, kind, std::move(names)));
    }
    const auto of = [&] {
      switch (kind) {
        case TransformKind::kToSpace:
          return built_in->to_space(names[0]);
        case TransformKind::kFromSpace:
          return built_in->from_space(names[0]);
        case TransformKind::kBetween:
          return built_in->between(names[0], names[1]);
        case TransformKind::kToDisplay:
          break;
      }
      return built_in->to_display(names[0], names[1], names[2]);
    };
    return ColorTransform(std::make_shared<const BuiltInTransform>(of()));
  }
};

ColorConfig ColorConfig::built_in() {
  return ColorConfig(std::make_shared<const State>(State{OcioConfig::built_in(), nullptr}));
}

ColorConfig ColorConfig::from_file(const std::filesystem::path& file,
                                   const std::string& rec709_name) {
  std::error_code error;
  if (!std::filesystem::is_regular_file(file, error)) {
    throw Error::bad_input("the colour config cannot be read: it is no file", file.string(),
                           "Give a valid OpenColorIO config (.ocio)");
  }
  auto given = std::make_shared<GivenConfig>(file, rec709_name);
  given->description = given->text(given->request(ColorQuestion::kDescription));
  return ColorConfig(std::make_shared<const State>(State{std::nullopt, std::move(given)}));
}

const std::string& ColorConfig::description() const {
  return state_->given ? state_->given->description : state_->built_in->description();
}

ColorTransform ColorConfig::to_space(const std::string& space) const {
  return state_->transform(TransformKind::kToSpace, {space, "", ""});
}

ColorTransform ColorConfig::from_space(const std::string& space) const {
  return state_->transform(TransformKind::kFromSpace, {space, "", ""});
}

ColorTransform ColorConfig::between(const std::string& from, const std::string& to) const {
  return state_->transform(TransformKind::kBetween, {from, to, ""});
}

ColorTransform ColorConfig::to_display(const std::string& space, const std::string& display,
                                       const std::string& view) const {
  return state_->transform(TransformKind::kToDisplay, {space, display, view});
}

std::string ColorConfig::interop_id(const std::string& space) const {
  if (!state_->given) return state_->built_in->interop_id(space);
  ColorRequest request = state_->given->request(ColorQuestion::kInteropId);
  request.names[0] = space;
  return state_->given->text(request);
}

std::string ColorConfig::space_from_interop_id(std::string_view id) const {
  if (!state_->given) return state_->built_in->space_from_interop_id(id);
  ColorRequest request = state_->given->request(ColorQuestion::kSpaceFromInteropId);
  request.names[0] = id;
  return state_->given->text(request);
}

}  // namespace raystage::compose
