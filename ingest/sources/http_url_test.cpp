// SPDX-License-Identifier: Apache-2.0
#include "ingest/sources/http_url.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "base/error.h"

namespace raystage::ingest {
namespace {

using ::testing::HasSubstr;

HttpUrl parsed(const std::string& url) { return {url, "camera"}; }

/// Returns where a redirection leads, or the error's text.
std::string target(const std::string& from, const std::string& to,
                   const HttpUrl::RedirectLimits& limits = {}) {
  try {
    return parsed(from).redirected(to, limits, "camera").text();
  } catch (const Error& error) {
    EXPECT_EQ(error.exit_code(), ExitCode::kBadInput);
    return error.what();
  }
}

TEST(HttpUrl, CredentialsAreKeptApart) {
  const HttpUrl url = parsed("http://me:p%40ss:w@rd@10.0.0.1:8080/a?b=c@d");
  EXPECT_EQ(url.text(), "http://10.0.0.1:8080/a?b=c@d");
  EXPECT_EQ(url.user(), "me");
  EXPECT_EQ(url.password(), "p@ss:w@rd");
  EXPECT_EQ(parsed("http://10.0.0.1/@x").user(), "");
  EXPECT_EQ(parsed("https://me@host").text(), "https://host/");
  EXPECT_TRUE(parsed("https://me@host").is_secure());
}

TEST(HttpUrl, WhatIsNoUrlOfHttpIsRefused) {
  for (const char* url : {"http://", "ftp://host/", "http://ho st/", "http://a:99999999/",
                          "http:", "file:///etc/passwd", "http://host\r\nX: y/"}) {
    EXPECT_THROW(parsed(url), Error) << url;
  }
  EXPECT_EQ(parsed("http://host/a b").text(), "http://host/a%20b");
}

TEST(HttpUrl, RedirectionsStayOnTheHost) {
  EXPECT_EQ(target("http://host/a/b", "c"), "http://host/a/c");
  EXPECT_EQ(target("http://host/a/b", "/c?d"), "http://host/c?d");
  EXPECT_EQ(target("http://host:80/", "http://HOST:8080/x"), "http://HOST:8080/x");
  EXPECT_EQ(target("http://host/", "https://host/x"), "https://host/x");
  EXPECT_EQ(target("http://[::1]:80/", "http://[::1]:81/"), "http://[::1]:81/");
  // Spellings of one address.
  EXPECT_EQ(target("http://host/", "http://other\\@host/"), "http://host/");
  EXPECT_EQ(target("http://127.0.0.1/", "http://0x7f000001/x"), "http://127.0.0.1/x");
  for (const char* elsewhere :
       {"http://other/", "//other/", "http://host.other/", "http://host@other/",
        "http://host:80@other/", "http://127.1/", "http://other:80/host", "http://other#host/",
        "http://other?@host/"}) {
    EXPECT_THAT(target("http://host/", elsewhere), HasSubstr("another host")) << elsewhere;
  }
  for (const char* never :
       {"file:///etc/passwd", "ftp://host/", "gopher://host/", "rtsp://host", "http://",
        "javascript:x", "http://h%6fst%252eother/", "http://host%00.other/"}) {
    EXPECT_THAT(target("http://host/", never, {.other_hosts = true}), HasSubstr("redirects"))
        << never;
  }
}

TEST(HttpUrl, LimitsAllowOtherHostsAndNoMore) {
  EXPECT_EQ(target("http://host/", "http://other/x", {.other_hosts = true}), "http://other/x");
  EXPECT_THAT(
      target("http://host/", "https://host/", {.other_hosts = true, .protocols = "http,tcp"}),
      HasSubstr("another protocol"));
  EXPECT_THAT(target("https://host/", "http://host/"), HasSubstr("from https to http"));
  EXPECT_THAT(target("https://host/", "http://other/", {.other_hosts = true}),
              HasSubstr("from https to http"));
}

TEST(HttpUrl, CredentialsGoToTheSameServerOnly) {
  const auto user = [](const std::string& from, const std::string& to) {
    const HttpUrl::RedirectLimits limits{.other_hosts = true};
    return parsed(from).redirected(to, limits, "camera").user();
  };
  EXPECT_EQ(user("http://me:x@host/", "/other"), "me");
  EXPECT_EQ(user("http://me:x@host/", "http://host:80/other"), "me");
  EXPECT_EQ(user("http://me:x@host/", "https://host/"), "me");
  EXPECT_EQ(user("http://me:x@host/", "http://host:81/"), "");
  EXPECT_EQ(user("http://me:x@host:81/", "https://host:81/"), "");
  EXPECT_EQ(user("http://me:x@host/", "http://other/"), "");
  EXPECT_EQ(user("http://me:x@host/", "http://camera:y@host:81/"), "") << "the camera's choice";
}

}  // namespace
}  // namespace raystage::ingest
