/* Output files: complete or not there at all; pipes, links and permissions are left as they are. */
#include <stdarg.h>
#include <stddef.h>
#include <setjmp.h>
#include <stdint.h>
#include <cmocka.h>

#include "base/base.h"

#include <dirent.h>
#include <fcntl.h>
#include <signal.h>
#include <stdio.h>
#include <string.h>
#include <sys/stat.h>
#include <unistd.h>

#define FOLDER KNURL_TEST_DIR "/file"

static void write_text(const char *path, const char *text)
{
    knurl_error error = {0};
    knurl_status status = knurl_file_write(path, text, strlen(text), &error);
    if (status != KNURL_OK) fail_msg("%s", error.message);
}

static void expect_text(const char *path, const char *text)
{
    char found[64] = {0};
    FILE *file = fopen(path, "rb");
    assert_non_null(file);
    (void)!fread(found, 1, sizeof found - 1, file);
    fclose(file);
    assert_string_equal(found, text);
}

static mode_t kind(const char *path)
{
    struct stat info;
    assert_int_equal(lstat(path, &info), 0);
    return info.st_mode;
}

static void empty_folder(void)
{
    (void)mkdir(FOLDER, 0777);
    DIR *folder = opendir(FOLDER);
    assert_non_null(folder);
    for (struct dirent *entry; (entry = readdir(folder));)
        if (entry->d_name[0] != '.') assert_int_equal(unlinkat(dirfd(folder), entry->d_name, 0), 0);
    closedir(folder);
}

static int count_files(void)
{
    int count = 0;
    DIR *folder = opendir(FOLDER);
    assert_non_null(folder);
    for (struct dirent *entry; (entry = readdir(folder));) count += entry->d_name[0] != '.';
    closedir(folder);
    return count;
}

static void test_complete_or_not_there(void **state)
{
    (void)state;
    const char *path = FOLDER "/a.txt";
    empty_folder();
    knurl_output output;
    assert_int_equal(knurl_output_open(path, &output, NULL), KNURL_OK);
    assert_int_equal(access(path, F_OK), -1);
    knurl_output_discard(&output);
    assert_int_equal(count_files(), 0);

    write_text(path, "first");
    expect_text(path, "first");
    assert_int_equal(knurl_output_open(path, &output, NULL), KNURL_OK);
    FILE *half = fopen(output.path, "wb");
    assert_non_null(half);
    fputs("half of th", half);
    fclose(half);
    expect_text(path, "first");
    knurl_output_discard(&output);
    knurl_output_discard(&output); /* twice is harmless */
    expect_text(path, "first");
    assert_int_equal(count_files(), 1);
}

static void test_two_at_once(void **state)
{
    (void)state;
    const char *path = FOLDER "/a.txt";
    empty_folder();
    knurl_output one, two;
    assert_int_equal(knurl_output_open(path, &one, NULL), KNURL_OK);
    assert_int_equal(knurl_output_open(path, &two, NULL), KNURL_OK);
    assert_string_not_equal(one.path, two.path);
    assert_int_equal(knurl_output_commit(&one, NULL), KNURL_OK);
    assert_int_equal(knurl_output_commit(&two, NULL), KNURL_OK);
    assert_int_equal(count_files(), 1);
}

static void test_permissions_and_links(void **state)
{
    (void)state;
    const char *path = FOLDER "/a.txt", *link = FOLDER "/link.txt";
    empty_folder();
    mode_t mask = umask(027);
    write_text(path, "new");
    umask(mask);
    assert_int_equal(kind(path) & 0777, 0640);
    assert_int_equal(chmod(path, 0604), 0);
    assert_int_equal(symlink("a.txt", link), 0);
    write_text(link, "through the link");
    assert_true(S_ISLNK(kind(link)));
    assert_int_equal(kind(path) & 0777, 0604);
    expect_text(path, "through the link");
    assert_int_equal(count_files(), 2);
}

/* A device is not tried here: code that replaced it would damage the machine that runs the test. */
static void test_pipe_is_written_in_place(void **state)
{
    (void)state;
    const char *path = FOLDER "/pipe", *link = FOLDER "/link";
    empty_folder();
    assert_int_equal(mkfifo(path, 0600), 0);
    assert_int_equal(symlink("pipe", link), 0);
    const char *const names[] = {path, link};
    for (int i = 0; i < 2; i++) {
        int reader = open(path, O_RDONLY | O_NONBLOCK | O_CLOEXEC);
        assert_true(reader >= 0);
        write_text(names[i], "to a pipe");
        char found[64] = {0};
        assert_int_equal(read(reader, found, sizeof found), 9);
        assert_string_equal(found, "to a pipe");
        close(reader);
        assert_true(S_ISFIFO(kind(path)));
        assert_true(S_ISLNK(kind(link)));
    }
    knurl_output output;
    assert_int_equal(knurl_output_open(path, &output, NULL), KNURL_OK);
    assert_string_equal(strrchr(output.path, '/'), "/pipe");
    knurl_output_discard(&output);
    assert_true(S_ISFIFO(kind(path)));
    assert_int_equal(count_files(), 2);
}

static void test_refused(void **state)
{
    (void)state;
    empty_folder();
    knurl_output output;
    knurl_error error = {0};
    assert_int_equal(knurl_output_open(FOLDER, &output, &error), KNURL_ERROR_OUTPUT);
    assert_non_null(strstr(error.message, "is a directory"));
    assert_int_equal(knurl_output_open("", &output, &error), KNURL_ERROR_OUTPUT);
    assert_int_equal(knurl_output_open(FOLDER "/no/a.txt", &output, &error), KNURL_ERROR_OUTPUT);
    assert_non_null(strstr(error.message, "/no/a.txt: No such file"));
    char name[5000];
    memset(name, 'a', sizeof name - 1);
    name[sizeof name - 1] = 0;
    assert_int_equal(knurl_output_open(name, &output, &error), KNURL_ERROR_OUTPUT);
    name[4090] = 0;
    assert_int_equal(knurl_output_open(name, &output, &error), KNURL_ERROR_OUTPUT);
    assert_int_equal(count_files(), 0);
}

int main(void)
{
    (void)signal(SIGPIPE, SIG_IGN);
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(test_complete_or_not_there),    cmocka_unit_test(test_two_at_once),
        cmocka_unit_test(test_permissions_and_links),    cmocka_unit_test(test_refused),
        cmocka_unit_test(test_pipe_is_written_in_place),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
