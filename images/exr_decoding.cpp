// SPDX-License-Identifier: Apache-2.0
#include "images/exr_decoding.h"

#include <OpenEXR/ImfChannelList.h>
#include <OpenEXR/ImfHeader.h>
#include <OpenEXR/ImfInputPart.h>
#include <OpenEXR/ImfMultiPartInputFile.h>
#include <OpenEXR/ImfMultiView.h>
#include <OpenEXR/ImfPartType.h>
#include <OpenEXR/ImfStandardAttributes.h>
#include <OpenEXR/ImfStringAttribute.h>
#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <cstdint>
#include <limits>
#include <new>

#include "base/error.h"
#include "images/exr_header_check.h"
#include "images/exr_slice.h"

namespace raystage::images {
namespace {

std::int64_t area(const Imath::Box2i& box) {
  return (std::int64_t{box.max.x} - box.min.x + 1) * (std::int64_t{box.max.y} - box.min.y + 1);
}

/// Returns the values of the display window from those of the data window, 0 outside it.
std::vector<float> crop_to_display(const Imath::Box2i& display, const Imath::Box2i& data,
                                   std::vector<float> values, std::size_t channels) {
  if (data == display) return values;
  std::vector<float> shown(static_cast<std::size_t>(area(display)) * channels, 0.0F);
  const int x0 = std::max(data.min.x, display.min.x), x1 = std::min(data.max.x, display.max.x);
  const int y0 = std::max(data.min.y, display.min.y), y1 = std::min(data.max.y, display.max.y);
  const auto at = [&](const Imath::Box2i& box, int y) {
    const auto width = static_cast<std::size_t>(box.max.x - box.min.x + 1);
    return (static_cast<std::size_t>(y - box.min.y) * width +
            static_cast<std::size_t>(x0 - box.min.x)) *
           channels;
  };
  for (int y = y0; y <= y1 && x0 <= x1; ++y) {
    std::copy_n(values.data() + at(data, y), static_cast<std::size_t>(x1 - x0 + 1) * channels,
                shown.data() + at(display, y));
  }
  return shown;
}

/// Returns a required channel that the part lacks, or null if it is flat and has all.
const char* missing_channel(const Imf::Header& header, std::span<const ExrChannel> channels) {
  if (header.hasType() && Imf::isDeepData(header.type())) return channels.front().name;
  for (const ExrChannel& channel : channels) {
    if (!channel.fallback && header.channels().findChannel(channel.name) == nullptr) {
      return channel.name;
    }
  }
  return nullptr;
}

std::string text_of(const Imf::Header& header, const char* attribute) {
  const auto* text = header.findTypedAttribute<Imf::StringAttribute>(attribute);
  return text == nullptr ? std::string() : text->value();
}

/// Returns "HH:MM:SS:FF", or an empty text if the header has no time code.
std::string time_code_of(const Imf::Header& header) {
  if (!Imf::hasTimeCode(header)) return {};
  const Imf::TimeCode time = Imf::timeCode(header);
  return fmt::format("{:02}:{:02}:{:02}:{:02}", time.hours(), time.minutes(), time.seconds(),
                     time.frame());
}

bool has_one(const Imf::Header& header, std::span<const ExrChannel> channels) {
  if (header.hasType() && Imf::isDeepData(header.type())) return false;
  return std::ranges::any_of(channels, [&](const ExrChannel& channel) {
    return header.channels().findChannel(channel.name) != nullptr;
  });
}

/// Returns the first part that has all required channels or, if none is required, any channel.
int part_with(const Imf::MultiPartInputFile& input, const std::filesystem::path& file,
              std::span<const ExrChannel> channels, const std::string& what_to_do) {
  if (std::ranges::all_of(channels,
                          [](const auto& channel) { return channel.fallback.has_value(); })) {
    for (int part = 0; part < input.parts(); ++part) {
      if (has_one(input.header(part), channels)) return part;
    }
  }
  for (int part = 0; part < input.parts(); ++part) {
    if (missing_channel(input.header(part), channels) == nullptr) return part;
  }
  throw Error::bad_input(
      std::string("the EXR file has no channel ") + missing_channel(input.header(0), channels),
      file.string(), what_to_do);
}

ExrChannelData read_part(Imf::MultiPartInputFile& file_parts, int part,
                         const std::filesystem::path& file, std::span<const ExrChannel> channels,
                         const std::string& what_to_do) {
  Imf::InputPart input(file_parts, part);
  const Imf::Header& header = input.header();
  const Imath::Box2i data = header.dataWindow(), display = header.displayWindow();
  constexpr std::int64_t kMaxPixels = std::int64_t{1} << 29;
  if (area(data) > kMaxPixels || area(display) > kMaxPixels) {
    throw Error::bad_input("the EXR file is larger than 2^29 pixels", file.string(), what_to_do);
  }
  std::vector<float> values(static_cast<std::size_t>(area(data)) * channels.size());
  Imf::FrameBuffer buffer;
  for (std::size_t c = 0; c < channels.size(); ++c) {
    buffer.insert(channels[c].name,
                  make_exr_slice(Imf::FLOAT, values.data() + c, data.max.x - data.min.x + 1,
                                 static_cast<int>(channels.size()), data.min.x, data.min.y,
                                 static_cast<double>(channels[c].fallback.value_or(0))));
  }
  input.setFrameBuffer(buffer);
  input.readPixels(data.min.y, data.max.y);

  ExrChannelData pixels;
  pixels.width = display.max.x - display.min.x + 1;
  pixels.height = display.max.y - display.min.y + 1;
  pixels.values = crop_to_display(display, data, std::move(values), channels.size());
  if (Imf::hasFramesPerSecond(header)) {
    const Imf::Rational fps = Imf::framesPerSecond(header);
    if (fps.n > 0 && fps.d > 0 && fps.d <= static_cast<unsigned>(std::numeric_limits<int>::max())) {
      pixels.fps_numerator = fps.n;
      pixels.fps_denominator = static_cast<int>(fps.d);
    }
  }
  pixels.time_code = time_code_of(header);
  pixels.color_interop_id = text_of(header, "colorInteropID");
  pixels.color_space = text_of(header, "lf:colorSpace");
  if (Imf::hasChromaticities(header)) {
    const Imf::Chromaticities& c = Imf::chromaticities(header);
    pixels.chromaticities = {c.red.x,  c.red.y,  c.green.x, c.green.y,
                             c.blue.x, c.blue.y, c.white.x, c.white.y};
  }
  pixels.is_equirectangular = Imf::hasEnvmap(header) && Imf::envmap(header) == Imf::ENVMAP_LATLONG;
  return pixels;
}

/// Where a file has the channels of a view.
struct ViewChannels {
  int part = 0;
  std::vector<std::string> names;  ///< in the part
  std::string missing;             ///< a required channel that the view lacks; empty: none
};

/// Adds the channels' names in a file of one part; those of the default view may name no view.
ViewChannels find_named_channels(const Imf::Header& header, const Imf::StringVector& views,
                                 int view, std::span<const ExrChannel> channels) {
  ViewChannels found;
  for (const ExrChannel& channel : channels) {
    const auto is_there = [&](const std::string& name) {
      return header.channels().findChannel(name.c_str()) != nullptr;
    };
    std::string name = Imf::insertViewName(channel.name, views, view);
    if (view == 0 && !is_there(name)) name = channel.name;
    if (!is_there(name) && !channel.fallback) found.missing = channel.name;
    found.names.push_back(std::move(name));
  }
  return found;
}

/// Returns the channels of a view, of the default one if `view` is empty; nullopt if the file has
/// no such view.
std::optional<ViewChannels> find_view_channels(const Imf::MultiPartInputFile& input,
                                               const std::string& view,
                                               std::span<const ExrChannel> channels) {
  std::optional<ViewChannels> incomplete;
  for (int part = 0; part < input.parts() && !view.empty(); ++part) {
    const Imf::Header& header = input.header(part);
    if (!header.hasView() || header.view() != view) continue;
    ViewChannels found{part, {}, {}};
    for (const ExrChannel& channel : channels) found.names.emplace_back(channel.name);
    const char* missing = missing_channel(header, channels);
    if (missing == nullptr) return found;
    found.missing = missing;
    if (!incomplete) incomplete = found;
  }
  const Imf::Header& first = input.header(0);
  if (incomplete || !Imf::hasMultiView(first)) return incomplete;
  const Imf::StringVector& views = Imf::multiView(first);
  const auto at = view.empty() ? views.begin() : std::ranges::find(views, view);
  if (at == views.end()) return std::nullopt;
  return find_named_channels(first, views, static_cast<int>(at - views.begin()), channels);
}

/// Returns whether the file has all required channels, of the default view if it has several.
bool is_complete(const Imf::MultiPartInputFile& input, const std::string& view,
                 std::span<const ExrChannel> channels) {
  for (int part = 0; part < input.parts() && view.empty(); ++part) {
    if (missing_channel(input.header(part), channels) == nullptr) return true;
  }
  const auto found = find_view_channels(input, view, channels);
  return found && found->missing.empty();
}

ExrChannelData read_view_of(Imf::MultiPartInputFile& input, const std::string& view,
                            const std::filesystem::path& file, std::span<const ExrChannel> channels,
                            const std::string& what_to_do) {
  const auto found = find_view_channels(input, view, channels);
  if (!found || !found->missing.empty()) {
    throw Error::bad_input(
        found ? fmt::format("view \"{}\" of the EXR file has no channel {}", view, found->missing)
              : fmt::format("the EXR file has no view \"{}\"", view),
        file.string(), what_to_do);
  }
  std::vector<ExrChannel> of_view(channels.begin(), channels.end());
  for (std::size_t i = 0; i < of_view.size(); ++i) of_view[i].name = found->names[i].c_str();
  return read_part(input, found->part, file, of_view, what_to_do);
}

/// Returns read(open file). Converts the exceptions of OpenEXR to Errors.
template <class Read>
auto read_file_with(const std::filesystem::path& file, const std::string& what_to_do,
                    const Read& read) {
  constexpr int kNoThreads = 0;  // callers already run in parallel
  try {
    require_plausible_exr_header(file);
    Imf::MultiPartInputFile input(file.c_str(), kNoThreads);
    return read(input);
  } catch (const Error&) {
    throw;
  } catch (const std::bad_alloc&) {
    throw;
  } catch (const std::exception& error) {
    std::string what = error.what();
    while (!what.empty() && (what.back() == '.' || what.back() == '\n')) what.pop_back();
    throw Error::bad_input("the EXR file cannot be read: " + what, file.string(), what_to_do);
  }
}

}  // namespace

ExrChannelData decode_exr_channels(const std::filesystem::path& file,
                                   std::span<const ExrChannel> channels,
                                   const std::string& what_to_do) {
  return read_file_with(file, what_to_do, [&](Imf::MultiPartInputFile& input) {
    // In files of several views a plain name may be that of no view.
    const auto of_default_view = find_view_channels(input, "", channels);
    if (of_default_view && of_default_view->missing.empty()) {
      return read_view_of(input, "", file, channels, what_to_do);
    }
    return read_part(input, part_with(input, file, channels, what_to_do), file, channels,
                     what_to_do);
  });
}

ExrChannelData decode_exr_view(const std::filesystem::path& file, const std::string& view,
                               std::span<const ExrChannel> channels,
                               const std::string& what_to_do) {
  return read_file_with(file, what_to_do, [&](Imf::MultiPartInputFile& input) {
    return read_view_of(input, view, file, channels, what_to_do);
  });
}

std::array<int, 2> decode_exr_size(const std::filesystem::path& file,
                                   std::span<const ExrChannel> channels,
                                   const std::string& what_to_do) {
  return read_file_with(file, what_to_do, [&](Imf::MultiPartInputFile& input) {
    const Imf::Header& header = input.header(part_with(input, file, channels, what_to_do));
    const Imath::Box2i& display = header.displayWindow();
    return std::array{display.max.x - display.min.x + 1, display.max.y - display.min.y + 1};
  });
}

bool decode_has_channels(const std::filesystem::path& file, std::span<const ExrChannel> channels,
                         const std::string& view) {
  return read_file_with(
      file, "Give an EXR file, or render it again",
      [&](Imf::MultiPartInputFile& input) { return is_complete(input, view, channels); });
}

}  // namespace raystage::images
