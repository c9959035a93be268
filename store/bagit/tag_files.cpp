// SPDX-License-Identifier: Apache-2.0
#include "store/bagit/tag_files.h"

#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <charconv>
#include <string_view>
#include <utility>

namespace raystage::store {
namespace {

constexpr bool is_blank(char c) { return c == ' ' || c == '\t'; }

char lower(char c) { return c >= 'A' && c <= 'Z' ? static_cast<char>(c - 'A' + 'a') : c; }

bool equal_ignoring_case(std::string_view a, std::string_view b) {
  return std::ranges::equal(a, b, {}, lower, lower);
}

std::string_view without_blanks(std::string_view text) {
  while (!text.empty() && is_blank(text.front())) text.remove_prefix(1);
  while (!text.empty() && is_blank(text.back())) text.remove_suffix(1);
  return text;
}

/// The lines of a tag file, which end with LF, CR or CRLF, numbered from 1.
class TagLines {
 public:
  explicit TagLines(std::string_view text) : rest_(text) {}

  std::optional<std::string_view> next() {
    if (rest_.empty()) return std::nullopt;
    ++number_;
    const std::size_t end = std::min(rest_.find_first_of("\r\n"), rest_.size());
    const std::string_view line = rest_.substr(0, end);
    rest_.remove_prefix(end);
    if (rest_.starts_with("\r\n")) {
      rest_.remove_prefix(2);
    } else if (!rest_.empty()) {
      rest_.remove_prefix(1);
    }
    return line;
  }
  std::string at_line(std::string_view what) const {
    return fmt::format("line {}: {}", number_, what);
  }

 private:
  std::string_view rest_;
  std::uint64_t number_ = 0;
};

template <class Number>
std::optional<Number> number_of(std::string_view text) {
  Number value{};
  const char* const end = text.data() + text.size();
  const auto [stop, code] = std::from_chars(text.data(), end, value);
  const bool is_number = !text.empty() && text.front() >= '0' && text.front() <= '9' &&
                         code == std::errc() && stop == end;
  return is_number ? std::optional(value) : std::nullopt;
}

/// Returns the value after "LABEL: ". Older drafts say nothing of white space there.
std::optional<std::string_view> declared(std::optional<std::string_view> line,
                                         std::string_view label, bool& is_exact) {
  if (!line || !line->starts_with(label)) return std::nullopt;
  std::string_view rest = line->substr(label.size());
  is_exact = is_exact && rest.starts_with(": ") && rest.size() > 2 && !is_blank(rest[2]) &&
             !is_blank(rest.back());
  while (!rest.empty() && is_blank(rest.front())) rest.remove_prefix(1);
  if (!rest.starts_with(':')) return std::nullopt;
  return without_blanks(rest.substr(1));
}

std::optional<BagVersion> version_of(std::string_view text) {
  const std::size_t dot = text.find('.');
  if (dot == std::string_view::npos) return std::nullopt;
  const auto major = number_of<int>(text.substr(0, dot));
  const auto minor = number_of<int>(text.substr(dot + 1));
  if (!major || !minor) return std::nullopt;
  return BagVersion{*major, *minor};
}

constexpr std::string_view kUtf8Mark = "\xef\xbb\xbf";

void append_utf8(std::string& text, std::uint32_t code) {
  if (code < 0x80) {
    text += static_cast<char>(code);
    return;
  }
  const int more = code < 0x800 ? 1 : code < 0x10000 ? 2 : 3;
  constexpr std::array<std::uint32_t, 4> kLead{0, 0xc0, 0xe0, 0xf0};
  text += static_cast<char>(kLead[static_cast<std::size_t>(more)] | (code >> (6 * more)));
  for (int i = more - 1; i >= 0; --i) text += static_cast<char>(0x80 | ((code >> (6 * i)) & 0x3f));
}

/// Whether bytes are UTF-8 as RFC 3629 has it: shortest forms, no surrogates, up to U+10FFFF.
bool is_utf8(std::string_view bytes) {
  for (std::size_t i = 0; i < bytes.size();) {
    const auto lead = static_cast<unsigned char>(bytes[i]);
    const std::size_t more = lead < 0x80 ? 0 : lead < 0xe0 ? 1 : lead < 0xf0 ? 2 : 3;
    if ((lead >= 0x80 && lead < 0xc2) || lead > 0xf4 || bytes.size() - i <= more) return false;
    std::uint32_t code = more == 0 ? lead : lead & (0x3fu >> more);
    for (std::size_t k = 1; k <= more; ++k) {
      const auto next = static_cast<unsigned char>(bytes[i + k]);
      if ((next & 0xc0u) != 0x80) return false;
      code = (code << 6) | (next & 0x3fu);
    }
    constexpr std::array<std::uint32_t, 4> kLeast{0, 0x80, 0x800, 0x10000};
    if (code < kLeast[more] || code > 0x10ffff || (code >= 0xd800 && code < 0xe000)) return false;
    i += more + 1;
  }
  return true;
}

std::optional<std::string> utf8_of_utf16(std::string_view bytes, bool is_big_endian) {
  if (bytes.size() % 2 != 0) return std::nullopt;
  const auto unit = [&](std::size_t i) {
    const auto a = static_cast<unsigned char>(bytes[i]);
    const auto b = static_cast<unsigned char>(bytes[i + 1]);
    return is_big_endian ? std::uint32_t{a} << 8 | b : std::uint32_t{b} << 8 | a;
  };
  std::string text;
  for (std::size_t i = 0; i < bytes.size(); i += 2) {
    std::uint32_t code = unit(i);
    if (code >= 0xdc00 && code < 0xe000) return std::nullopt;
    if (code >= 0xd800 && code < 0xdc00) {
      if (i + 4 > bytes.size()) return std::nullopt;
      const std::uint32_t low = unit(i += 2);
      if (low < 0xdc00 || low >= 0xe000) return std::nullopt;
      code = 0x10000 + ((code - 0xd800) << 10) + (low - 0xdc00);
    }
    append_utf8(text, code);
  }
  return text;
}

}  // namespace

void TagFileFindings::fault(std::string what) {
  if (faults_.size() < kMost) {
    faults_.push_back(std::move(what));
  } else {
    ++omitted_;
  }
}

void TagFileFindings::warning(std::string what) {
  if (warnings_.size() < kMost) {
    warnings_.push_back(std::move(what));
  } else {
    ++omitted_;
  }
}

std::optional<BagDeclaration> parse_bag_declaration(std::string_view bytes,
                                                    TagFileFindings& findings) {
  if (bytes.starts_with(kUtf8Mark)) {
    findings.fault("it begins with a byte order mark");
    bytes.remove_prefix(kUtf8Mark.size());
  }
  TagLines lines(bytes);
  bool is_exact = true;
  const auto version = declared(lines.next(), "BagIt-Version", is_exact);
  const auto encoding = declared(lines.next(), "Tag-File-Character-Encoding", is_exact);
  const auto parsed = version ? version_of(*version) : std::nullopt;
  if (!parsed || !encoding || encoding->empty()) {
    findings.fault(
        "it does not hold the lines \"BagIt-Version: M.N\" and \"Tag-File-Character-Encoding: "
        "NAME\"");
    return std::nullopt;
  }
  if (!is_exact && *parsed >= BagVersion{0, 97}) {
    findings.fault("its lines have white space other than one space after the colon");
  } else if (!is_exact) {
    findings.warning("its lines have white space other than one space after the colon");
  }
  if (lines.next()) findings.fault("it has more than two lines");
  return BagDeclaration{*parsed, std::string(*encoding)};
}

std::optional<std::string> utf8_of_tag_file(std::string_view bytes, std::string_view encoding,
                                            TagFileFindings& findings) {
  const auto is_named = [&](std::initializer_list<std::string_view> names) {
    return std::ranges::any_of(
        names, [&](std::string_view name) { return equal_ignoring_case(name, encoding); });
  };
  const auto invalid = [&] {
    findings.fault(fmt::format("it is not valid {}", encoding));
    return std::nullopt;
  };
  if (is_named({"UTF-8", "UTF8", "US-ASCII", "ASCII"})) {
    if (bytes.starts_with(kUtf8Mark)) {
      findings.warning("it begins with a byte order mark");
      bytes.remove_prefix(kUtf8Mark.size());
    }
    if (!is_utf8(bytes)) return invalid();
    return std::string(bytes);
  }
  if (is_named({"ISO-8859-1", "ISO8859-1", "LATIN1"})) {
    std::string text;
    for (const char c : bytes) append_utf8(text, static_cast<unsigned char>(c));
    return text;
  }
  if (is_named({"UTF-16", "UTF-16BE", "UTF-16LE"})) {
    bool is_big_endian = !is_named({"UTF-16LE"});
    const bool is_marked_big = bytes.starts_with("\xfe\xff");
    const bool is_marked_little = bytes.starts_with("\xff\xfe");
    if (is_marked_big || is_marked_little) {
      if (is_named({"UTF-16"})) is_big_endian = is_marked_big;
      if (is_big_endian != is_marked_big) return invalid();
      bytes.remove_prefix(2);
    }
    auto text = utf8_of_utf16(bytes, is_big_endian);
    if (!text) return invalid();
    return text;
  }
  findings.fault(fmt::format("its encoding {} is not supported", encoding));
  return std::nullopt;
}

std::string encode_bag_path(std::string_view path) {
  std::string text;
  for (const char c : path) {
    if (c == '%') {
      text += "%25";
    } else if (c == '\r') {
      text += "%0D";
    } else if (c == '\n') {
      text += "%0A";
    } else {
      text += c;
    }
  }
  return text;
}

std::optional<std::string> decode_bag_path(std::string_view text, BagVersion version,
                                           TagFileFindings& findings) {
  std::string decoded;
  for (std::size_t i = 0; i < text.size(); ++i) {
    if (text[i] != '%') {
      decoded += text[i];
      continue;
    }
    const std::string_view code = text.substr(i + 1, std::min<std::size_t>(2, text.size() - i - 1));
    const bool has_all_codes = version >= kBagVersion1;
    if (equal_ignoring_case(code, "0a")) {
      decoded += '\n';
    } else if (equal_ignoring_case(code, "0d")) {
      decoded += '\r';
    } else if (has_all_codes && code == "25") {
      decoded += '%';
    } else {
      if (has_all_codes) {
        findings.warning(fmt::format("\"{}\" has a '%' that is not encoded as %25", text));
      }
      decoded += '%';
      continue;
    }
    i += 2;
  }
  const auto refuse = [&](std::string_view why) {
    findings.fault(fmt::format("\"{}\" {}", text, why));
    return std::nullopt;
  };
  if (decoded.empty()) return refuse("is no path");
  if (decoded.front() == '/') return refuse("is an absolute path");
  if (decoded.find('\0') != std::string::npos) return refuse("holds a zero byte");
  if (decoded.back() == '/') return refuse("names a folder");
  std::string plain;
  bool has_removed_parts = false;
  for (std::size_t begin = 0; begin < decoded.size();) {
    const std::size_t end = std::min(decoded.find('/', begin), decoded.size());
    const std::string_view part = std::string_view(decoded).substr(begin, end - begin);
    begin = end + 1;
    if (part == "..") return refuse("leaves its folder");
    if (part.empty() || part == ".") {
      has_removed_parts = true;
      continue;
    }
    if (!plain.empty()) plain += '/';
    plain += part;
  }
  if (plain.empty()) return refuse("is no path");
  if (plain.front() == '~') return refuse("begins with ~, which means a home folder");
  if (has_removed_parts) {
    findings.warning(fmt::format("\"{}\" has parts that are empty or \".\"", text));
  }
  return plain;
}

BagManifest parse_bag_manifest(std::string_view text, BagVersion version, std::size_t digits,
                               TagFileFindings& findings) {
  BagManifest manifest;
  TagLines lines(text);
  bool has_stars = false;
  while (const auto line = lines.next()) {
    if (without_blanks(*line).empty()) {
      findings.warning(lines.at_line("it is empty"));
      continue;
    }
    const std::size_t end = std::min(line->find_first_of(" \t"), line->size());
    std::string digest(line->substr(0, end));
    std::ranges::transform(digest, digest.begin(), lower);
    const bool is_digest = !digest.empty() && (digits == 0 || digest.size() == digits) &&
                           digest.find_first_not_of("0123456789abcdef") == std::string::npos;
    std::string_view path = line->substr(end);
    while (!path.empty() && is_blank(path.front())) path.remove_prefix(1);
    if (!is_digest || path.empty()) {
      findings.fault(lines.at_line("a checksum, white space and a path were expected"));
      continue;
    }
    if (path.front() == '*') {  // md5sum marks binary files so
      has_stars = true;
      path.remove_prefix(1);
    }
    auto decoded = decode_bag_path(path, version, findings);
    if (decoded) manifest.entries.push_back({std::move(*decoded), std::move(digest)});
  }
  if (has_stars) findings.warning("paths begin with '*', as md5sum writes them");
  std::ranges::stable_sort(manifest.entries, {}, &BagManifest::Entry::path);
  const auto repeats = [&](const BagManifest::Entry& a, const BagManifest::Entry& b) {
    if (a.path != b.path) return false;
    const std::string what = fmt::format("\"{}\" is listed twice", a.path);
    if (version >= kBagVersion1 || a.digest != b.digest) {
      findings.fault(what);
    } else {
      findings.warning(what);
    }
    return true;
  };
  manifest.entries.erase(std::unique(manifest.entries.begin(), manifest.entries.end(), repeats),
                         manifest.entries.end());
  return manifest;
}

std::vector<BagFetchEntry> parse_bag_fetch(std::string_view text, BagVersion version,
                                           TagFileFindings& findings) {
  std::vector<BagFetchEntry> entries;
  TagLines lines(text);
  while (const auto line = lines.next()) {
    std::string_view rest = without_blanks(*line);
    if (rest.empty()) continue;
    const auto word = [&] {
      const std::size_t end = std::min(rest.find_first_of(" \t"), rest.size());
      const std::string_view found = rest.substr(0, end);
      rest.remove_prefix(end);
      while (!rest.empty() && is_blank(rest.front())) rest.remove_prefix(1);
      return found;
    };
    BagFetchEntry entry;
    entry.url = word();
    const std::string_view length = word();
    entry.bytes = number_of<std::uint64_t>(length);
    if (rest.empty() || (!entry.bytes && length != "-")) {
      findings.fault(lines.at_line("a URL, a length or '-', and a path were expected"));
      continue;
    }
    auto path = decode_bag_path(rest, version, findings);
    if (!path) continue;
    entry.path = std::move(*path);
    entries.push_back(std::move(entry));
  }
  return entries;
}

BagInfo parse_bag_info(std::string_view text, BagVersion version, TagFileFindings& findings) {
  BagInfo info;
  TagLines lines(text);
  while (const auto line = lines.next()) {
    if (without_blanks(*line).empty()) continue;
    if (is_blank(line->front())) {  // continues the value
      if (info.elements.empty()) {
        findings.fault(lines.at_line("it continues a value, but there is none before it"));
        continue;
      }
      std::string& value = info.elements.back().value;
      if (!value.empty()) value += ' ';
      value += without_blanks(*line);
      continue;
    }
    const std::size_t colon = line->find(':');
    if (colon == std::string_view::npos || colon == 0) {
      findings.fault(lines.at_line("\"LABEL: VALUE\" was expected"));
      continue;
    }
    const std::string_view label = line->substr(0, colon);
    if (is_blank(label.back())) {
      const std::string what = lines.at_line("there is white space before the colon");
      if (version >= kBagVersion1) {
        findings.fault(what);
      } else {
        findings.warning(what);
      }
    }
    info.elements.push_back(
        {std::string(without_blanks(label)), std::string(without_blanks(line->substr(colon + 1)))});
  }
  int stated = 0;
  for (const BagInfo::Element& element : info.elements) {
    if (!equal_ignoring_case(element.label, "Payload-Oxum")) continue;
    if (++stated == 2) findings.fault("Payload-Oxum is stated twice");
    const std::size_t dot = std::min(element.value.find('.'), element.value.size());
    const std::string_view value = element.value;
    const auto bytes = number_of<std::uint64_t>(value.substr(0, dot));
    const auto files =
        dot < value.size() ? number_of<std::uint64_t>(value.substr(dot + 1)) : std::nullopt;
    if (bytes && files) {
      info.oxum = BagInfo::Oxum{*bytes, *files};
    } else {
      findings.fault(fmt::format("Payload-Oxum is \"{}\": BYTES.FILES was expected", value));
    }
  }
  return info;
}

}  // namespace raystage::store
