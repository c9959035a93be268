// SPDX-License-Identifier: Apache-2.0
// Internal to ingest/sources.
#pragma once

#include <memory>
#include <string>

// Of libcurl, whose header defines macros.
struct Curl_URL;

namespace raystage::ingest {

/// A URL of http or https, as libcurl reads it. The same parser serves to compare hosts and to
/// connect, so that no spelling of a URL can make them differ.
class HttpUrl {
 public:
  /// User name and password in `url` are kept apart from it. Throws Error (bad input) if it is not
  /// a URL of http or https. `where` names the camera in errors.
  HttpUrl(const std::string& url, const std::string& where);

  /// What a camera may redirect to.
  struct RedirectLimits {
    bool other_hosts = false;
    /// Names of protocols separated by commas, as FFmpeg's protocol_whitelist.
    std::string protocols = "http,https";
  };
  /// Returns the URL to which `location`, absolute or relative, redirects, with the user name and
  /// password of this one if shares_secrets_with() is true. Throws Error (bad input) if the limits
  /// forbid it, or if it leads from https to http.
  HttpUrl redirected(const std::string& location, const RedirectLimits& limits,
                     const std::string& where) const;

  std::string text() const;  ///< without user name and password
  const std::string& user() const { return user_; }
  const std::string& password() const { return password_; }
  Curl_URL* handle() const { return url_.get(); }
  bool is_secure() const;
  /// Returns whether the host is the same, whatever the port.
  bool has_same_host(const HttpUrl& other) const;
  /// Returns whether what is meant for this URL's server may be sent to that of `other`: the same
  /// scheme, host and port, or https on port 443 after http on port 80 of the same host.
  bool shares_secrets_with(const HttpUrl& other) const;

 private:
  struct Deleter {
    void operator()(Curl_URL* url) const;
  };
  HttpUrl() = default;
  std::string part(int which) const;

  std::unique_ptr<Curl_URL, Deleter> url_;
  std::string user_, password_;
};

}  // namespace raystage::ingest
