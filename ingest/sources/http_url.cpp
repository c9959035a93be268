// SPDX-License-Identifier: Apache-2.0
#include "ingest/sources/http_url.h"

#include <fmt/format.h>

extern "C" {
#include <libavutil/avstring.h>
}

#include <new>

#include "base/error.h"
#include "ingest/sources/configuration_error.h"
#include "ingest/sources/libcurl.h"

namespace raystage::ingest {
namespace {

// As FFmpeg, which sends what it is given.
constexpr unsigned kTolerant = CURLU_ALLOW_SPACE | CURLU_URLENCODE;

/// Returns the name and password as they were before percent encoding.
std::string decoded(std::string_view text) {
  std::string bytes;
  const auto digit = [](char c) {
    if (c >= '0' && c <= '9') return c - '0';
    c = static_cast<char>(av_tolower(c));
    return c >= 'a' && c <= 'f' ? c - 'a' + 10 : -1;
  };
  for (std::size_t i = 0; i < text.size(); ++i) {
    if (text[i] == '%' && i + 2 < text.size() && digit(text[i + 1]) >= 0 &&
        digit(text[i + 2]) >= 0) {
      bytes += static_cast<char>(digit(text[i + 1]) * 16 + digit(text[i + 2]));
      i += 2;
    } else {
      bytes += text[i];
    }
  }
  return bytes;
}

ConfigurationError not_a_url(CURLUcode code, const std::string& where) {
  return ConfigurationError(Error::bad_input(
      fmt::format("the address is no URL of http: {}", libcurl().url_strerror(code)), where,
      "Correct it, for example http://10.0.0.1/video"));
}

}  // namespace

void HttpUrl::Deleter::operator()(Curl_URL* url) const { libcurl().url_cleanup(url); }

HttpUrl::HttpUrl(const std::string& url, const std::string& where) : url_(libcurl().url()) {
  if (!url_) throw std::bad_alloc();
  // Passwords with '@' that is not encoded are usual, and libcurl refuses them.
  const std::size_t host = url.find("//");
  std::string bare = url;
  if (host != url.npos) {
    const std::size_t end = url.find_first_of("/?#", host + 2);
    const std::size_t at = end == url.npos ? url.rfind('@') : url.rfind('@', end);
    if (at != url.npos && at > host) {
      const std::string_view credentials = std::string_view(url).substr(host + 2, at - host - 2);
      const std::size_t colon = credentials.find(':');
      user_ = decoded(credentials.substr(0, colon));
      if (colon != credentials.npos) password_ = decoded(credentials.substr(colon + 1));
      bare.erase(host + 2, at - host - 1);
    }
  }
  const CURLUcode code = libcurl().url_set(url_.get(), CURLUPART_URL, bare.c_str(), kTolerant);
  if (code != CURLUE_OK) throw not_a_url(code, where);
  const std::string scheme = part(CURLUPART_SCHEME);
  if (scheme != "http" && scheme != "https") throw not_a_url(CURLUE_UNSUPPORTED_SCHEME, where);
}

HttpUrl HttpUrl::redirected(const std::string& location, const RedirectLimits& limits,
                            const std::string& where) const {
  HttpUrl target;
  target.url_.reset(libcurl().url_dup(url_.get()));
  if (!target.url_) throw std::bad_alloc();
  const auto refused = [&](const std::string& what) {
    return Error::bad_input(what, where,
                            "Give that address if you trust it, or set the option "
                            "protocol_whitelist of the source");
  };
  const CURLUcode code =
      libcurl().url_set(target.url_.get(), CURLUPART_URL, location.c_str(), kTolerant);
  const std::string scheme = code == CURLUE_OK ? target.part(CURLUPART_SCHEME) : "";
  // libcurl decodes a host, and reads the URL again after a password was asked for: another host.
  if (target.part(CURLUPART_HOST).find('%') != std::string::npos) {
    throw refused("the camera redirects to a host with an encoded name");
  }
  if (scheme != "http" && scheme != "https") {
    throw refused("the camera redirects to what is no URL of http");
  }
  libcurl().url_set(target.url_.get(), CURLUPART_USER, nullptr, 0);
  libcurl().url_set(target.url_.get(), CURLUPART_PASSWORD, nullptr, 0);
  if (!has_same_host(target) && !limits.other_hosts) {
    throw refused("the camera redirects to another host, " + target.text());
  }
  if (is_secure() && !target.is_secure()) {
    throw refused("the camera redirects from https to http, " + target.text());
  }
  if (av_match_list(scheme.c_str(), limits.protocols.c_str(), ',') <= 0) {
    throw refused("the camera redirects to another protocol, " + target.text());
  }
  if (shares_secrets_with(target)) {
    target.user_ = user_;
    target.password_ = password_;
  }
  return target;
}

std::string HttpUrl::part(int which) const {
  char* text = nullptr;
  const unsigned flags = which == CURLUPART_PORT ? CURLU_DEFAULT_PORT : 0;
  if (libcurl().url_get(url_.get(), static_cast<CURLUPart>(which), &text, flags) != CURLUE_OK)
    return "";
  const std::unique_ptr<char, decltype(&curl_free)> owner(text, libcurl().free);
  return text;
}

std::string HttpUrl::text() const { return part(CURLUPART_URL); }

bool HttpUrl::is_secure() const { return part(CURLUPART_SCHEME) == "https"; }

bool HttpUrl::has_same_host(const HttpUrl& other) const {
  const std::string mine = part(CURLUPART_HOST);
  // Addresses of IPv6 that are local to a link are other machines behind other network interfaces.
  return !mine.empty() && av_strcasecmp(mine.c_str(), other.part(CURLUPART_HOST).c_str()) == 0 &&
         part(CURLUPART_ZONEID) == other.part(CURLUPART_ZONEID);
}

bool HttpUrl::shares_secrets_with(const HttpUrl& other) const {
  if (!has_same_host(other)) return false;
  const std::string from = part(CURLUPART_PORT), to = other.part(CURLUPART_PORT);
  if (is_secure() == other.is_secure()) return from == to;
  return from == "80" && to == "443" && other.is_secure();
}

}  // namespace raystage::ingest
