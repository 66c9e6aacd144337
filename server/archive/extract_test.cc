#include "server/archive/extract.h"

#include <archive.h>
#include <archive_entry.h>
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <clocale>
#include <cstdint>

#include "engine/core/error_test_util.h"
#include "server/testing/archives.h"

namespace litags {
namespace {

using ::testing::ElementsAre;
using ::testing::HasSubstr;
using ::testing::Pair;

struct Entry {
  std::string name;
  std::string bytes;
  unsigned type = AE_IFREG;
  std::string link = {};
};

// Archives as other programs make them, by the writing half of the library.
std::string Pack(const std::vector<Entry>& entries, const std::string& kind) {
  std::string out(64 << 20, '\0');
  size_t used = 0;
  archive* writer = archive_write_new();
  if (kind == "zip") {
    archive_write_set_format_zip(writer);
  } else {
    archive_write_set_format_pax_restricted(writer);
    if (kind == "tgz") archive_write_add_filter_gzip(writer);
  }
  archive_write_open_memory(writer, out.data(), out.size(), &used);
  for (const Entry& e : entries) {
    archive_entry* entry = archive_entry_new();
    archive_entry_set_pathname(entry, e.name.c_str());
    archive_entry_set_filetype(entry, e.type);
    archive_entry_set_perm(entry, 0644);
    if (e.type == AE_IFLNK) archive_entry_set_symlink(entry, e.link.c_str());
    if (e.type == AE_IFREG && !e.link.empty()) archive_entry_set_hardlink(entry, e.link.c_str());
    archive_entry_set_size(entry, static_cast<la_int64_t>(e.bytes.size()));
    EXPECT_EQ(archive_write_header(writer, entry), ARCHIVE_OK) << archive_error_string(writer);
    archive_write_data(writer, e.bytes.data(), e.bytes.size());
    archive_entry_free(entry);
  }
  archive_write_close(writer);
  archive_write_free(writer);
  out.resize(used);
  return out;
}

absl::Status Extract(const std::string& bytes, ArchiveLimits limits = {}, MapSink* sink = nullptr) {
  MapSink unused;
  return ExtractArchiveBytes(bytes, limits, "archives[a]", sink ? sink : &unused);
}

class Archives : public ::testing::TestWithParam<std::string> {};

TEST_P(Archives, FilesComeWithTheirFoldersAndAllBytes) {
  const std::string large(1'000'000, 'x');  // several blocks
  MapSink sink;
  const absl::Status status = Extract(Pack({{"set/", "", AE_IFDIR},
                                            {"set/images/1.jpg", large},
                                            {"./2.jpg", "two"},
                                            {"set/unwanted", "other"}},
                                           GetParam()),
                                      {}, &sink);
  ASSERT_TRUE(status.ok()) << status;
  EXPECT_THAT(sink.files, ElementsAre(Pair("2.jpg", "two"), Pair("set|images|1.jpg", large)));
  EXPECT_EQ(sink.ended, 2);
}

TEST_P(Archives, NamesMayHoldAnyCharacterWhateverTheLocale) {
  ASSERT_TRUE(std::setlocale(LC_CTYPE, "C.UTF-8"));  // of the program that packs
  const std::string bytes = Pack({{"Küche/a.png", "a"}, {"写真/1.png", "b"}}, GetParam());
  ASSERT_TRUE(std::setlocale(LC_CTYPE, "C"));
  MapSink sink;
  const absl::Status status = Extract(bytes, {}, &sink);
  ASSERT_TRUE(status.ok()) << status;
  EXPECT_THAT(sink.files, ElementsAre(Pair("Küche|a.png", "a"), Pair("写真|1.png", "b")));
}

TEST_P(Archives, NamesThatLeadElsewhereAreRefusedByName) {
  for (const std::string name :
       {"../evil.jpg", "a/../../evil.jpg", "/etc/evil.jpg", "C:/evil.jpg", "a/.."}) {
    const absl::Status status = Extract(Pack({{name, "x"}}, GetParam()));
    EXPECT_EQ(Reason(status), "ARCHIVE_ENTRY_UNSAFE") << name;
    EXPECT_EQ(status.code(), absl::StatusCode::kInvalidArgument);
    EXPECT_EQ(GetErrorDetail(status).value_or(ErrorDetail()).field, "archives[a]");
    EXPECT_THAT(std::string(status.message()), HasSubstr(name));
  }
}

TEST_P(Archives, LinksAreRefused) {
  EXPECT_EQ(Reason(Extract(Pack({{"a.jpg", "", AE_IFLNK, "/etc/passwd"}}, GetParam()))),
            "ARCHIVE_ENTRY_UNSAFE");
}

TEST_P(Archives, EntriesAndBytesAreBounded) {
  ArchiveLimits limits;
  limits.max_entries = 2;
  EXPECT_TRUE(Extract(Pack({{"1", "x"}, {"2", "x"}}, GetParam()), limits).ok());
  EXPECT_EQ(Reason(Extract(Pack({{"1", "x"}, {"2", "x"}, {"3", "x"}}, GetParam()), limits)),
            "ARCHIVE_TOO_MANY_ENTRIES");
  limits = {};
  limits.max_entry_bytes = 3;
  EXPECT_TRUE(Extract(Pack({{"1", "xxx"}}, GetParam()), limits).ok());
  const absl::Status large = Extract(Pack({{"big.jpg", "xxxx"}}, GetParam()), limits);
  EXPECT_EQ(Reason(large), "ARCHIVE_ENTRY_TOO_LARGE");
  EXPECT_THAT(std::string(large.message()), HasSubstr("big.jpg"));
  limits = {};
  limits.max_total_bytes = 5;
  EXPECT_EQ(Reason(Extract(Pack({{"1", "xxx"}, {"unwanted", "xxx"}}, GetParam()), limits)),
            "ARCHIVE_TOO_LARGE");
}

TEST_P(Archives, AnEntryThatIsNotWantedMayBeLarger) {
  ArchiveLimits limits;
  limits.max_entry_bytes = 3;
  const std::string bytes = Pack({{"unwanted", "xxxx"}, {"1.jpg", "xxx"}}, GetParam());
  MapSink sink;
  const absl::Status status = Extract(bytes, limits, &sink);
  ASSERT_TRUE(status.ok()) << status;
  EXPECT_THAT(sink.files, ElementsAre(Pair("1.jpg", "xxx")));
}

TEST_P(Archives, EveryPrefixIsRefusedOrReadAndNothingCrashes) {
  const std::string whole = Pack({{"a.jpg", std::string(3000, 'a')}, {"b.jpg", "b"}}, GetParam());
  for (size_t size = 0; size < whole.size(); size += 97) {
    MapSink sink;
    const absl::Status status = Extract(whole.substr(0, size), {}, &sink);
    // A TAR may lack its two empty blocks at the end, nothing else.
    if (status.ok()) {
      EXPECT_EQ(sink.files.size(), 2u) << size;
    }
  }
}

INSTANTIATE_TEST_SUITE_P(Formats, Archives, ::testing::Values("zip", "tar", "tgz"),
                         [](const auto& info) { return info.param; });

TEST(Archive, HardLinksDevicesAndPipesOfTarFilesAreRefused) {
  EXPECT_EQ(Reason(Extract(Pack({{"a", "x"}, {"b", "", AE_IFREG, "a"}}, "tar"))),
            "ARCHIVE_ENTRY_UNSAFE");
  for (const unsigned type : {AE_IFCHR, AE_IFBLK, AE_IFIFO}) {
    EXPECT_EQ(Reason(Extract(Pack({{"dev", "", type}}, "tar"))), "ARCHIVE_ENTRY_UNSAFE");
  }
}

TEST(Archive, BackslashesAreRefusedUnlessTheyAreAZipsFolders) {
  EXPECT_EQ(Reason(Extract(Pack({{"a\\evil.jpg", "x"}}, "tar"))), "ARCHIVE_ENTRY_UNSAFE");
  MapSink sink;  // as some programs on Windows pack
  ASSERT_TRUE(Extract(Pack({{"a\\1.jpg", "x"}}, "zip"), {}, &sink).ok());
  EXPECT_THAT(sink.files, ElementsAre(Pair("a|1.jpg", "x")));
  EXPECT_EQ(Reason(Extract(Pack({{"..\\evil.jpg", "x"}}, "zip"))), "ARCHIVE_ENTRY_UNSAFE");
}

// Stored, without the mark that names are UTF-8 unless `flags` has it, and the list of contents at
// the end.
std::string ZipOf(const std::string& name, const std::string& bytes, uint32_t crc,
                  uint32_t flags = 0) {
  const auto number = [](uint32_t value, int size) {
    std::string out;
    for (int i = 0; i < size; ++i) out += static_cast<char>(value >> (8 * i));
    return out;
  };
  const auto size = static_cast<uint32_t>(bytes.size());
  const std::string about = number(20, 2) + number(flags, 2) + std::string(6, 0) + number(crc, 4) +
                            number(size, 4) + number(size, 4) +
                            number(static_cast<uint32_t>(name.size()), 2) + number(0, 2);
  const std::string file = "PK\3\4" + about + name + bytes;
  const std::string listed = "PK\1\2" + number(20, 2) + about + std::string(14, 0) + name;
  return file + listed + "PK\5\6" + number(0, 4) + number(1, 2) + number(1, 2) +
         number(static_cast<uint32_t>(listed.size()), 4) +
         number(static_cast<uint32_t>(file.size()), 4) + number(0, 2);
}

TEST(Archive, NamesOfWindowsZipsAreInItsOldCharacterSet) {
  const auto name_of = [](const std::string& name) {
    MapSink sink;
    const absl::Status status = Extract(ZipOf(name, "a", 0xE8B7BE43), {}, &sink);
    EXPECT_TRUE(status.ok()) << status;
    return sink.files.empty() ? "" : sink.files.begin()->first;
  };
  EXPECT_EQ(name_of("M\x94"
                    "bel/K\x81"
                    "che 1.jpg"),
            "Möbel|Küche 1.jpg");
  EXPECT_EQ(name_of("stra\xE1"
                    "e \x80\xFF.jpg"),
            "straße Ç\u00A0.jpg");
  EXPECT_EQ(name_of("K\xC3\xBC"
                    "che.jpg"),
            "Küche.jpg");  // UTF-8 without the mark, as Macs write
  EXPECT_EQ(Reason(Extract(Tar({{"K\x81"
                                 "che.jpg",
                                 "a"}}))),
            "");  // a TAR's stays as it is
}

TEST(Archive, DamagedOnesAreRefusedWithTheEntryWhereTheyAre) {
  for (const std::string& bytes :
       {ZipOf("a.jpg", "a", 0), Tar({{"a.jpg", std::string(3000, 'a')}}).substr(0, 1024)}) {
    const absl::Status status = Extract(bytes);
    EXPECT_EQ(Reason(status), "ARCHIVE_CORRUPT");
    EXPECT_THAT(std::string(status.message()), HasSubstr("from the entry a.jpg on"));
  }
}

TEST(Archive, EncryptedOnesAreRefused) {
  EXPECT_EQ(Reason(Extract(ZipOf("a.jpg", "a", 0xE8B7BE43, 1))), "ARCHIVE_ENCRYPTED");
}

TEST(Archive, NamesAreShownAsUtf8) {
  EXPECT_EQ(ShownName("Küche\n.jpg"), "Küche\\n.jpg");
  EXPECT_EQ(ShownName("K\x81"
                      "che.jpg"),
            "K\uFFFDche.jpg");
  EXPECT_EQ(ShownName(std::string(300, 'a')), std::string(200, 'a') + "...");
}

TEST(Archive, BombsAreStoppedLongBeforeTheyAreUnpacked) {
  const std::string bomb = Pack({{"a.png", std::string(100 << 20, '\0')}}, "tgz");
  ASSERT_LT(bomb.size(), 200'000u);
  MapSink sink;
  EXPECT_EQ(Reason(Extract(bomb, {}, &sink)), "ARCHIVE_RATIO_TOO_LARGE");
  EXPECT_LT(sink.files["a.png"].size(), size_t{65} << 20);
}

TEST(Archive, OtherFilesAndEmptyArchivesAreRefused) {
  EXPECT_EQ(Reason(Extract("this is no archive at all, but it is long enough to look at")),
            "ARCHIVE_NOT_RECOGNIZED");
  EXPECT_EQ(Reason(Extract(Pack({{"folder/", "", AE_IFDIR}}, "zip"))), "ARCHIVE_EMPTY");
}

}  // namespace
}  // namespace litags
