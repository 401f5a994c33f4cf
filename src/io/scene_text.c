/* Lines, words and numbers. Numbers are converted here and not by strtod alone, because that follows
 * the locale of the program that knurl lives in. */
#include "io/scene_text.h"

#include <locale.h>
#include <math.h>
#include <stdlib.h>
#include <string.h>

static bool is_blank(char c)
{
    return c == ' ' || c == '\t' || c == '\r' || c == '\v' || c == '\f' || c == 0;
}

bool text_next_line(text_lines *lines, text_span *line)
{
    if (lines->at >= lines->end) return false;
    lines->line += 1 + lines->joined;
    lines->joined = 0;
    char *begin = lines->at, *stop;
    if (lines->line == 1 && lines->end - begin >= 3 && memcmp(begin, "\xef\xbb\xbf", 3) == 0)
        memset(begin, ' ', 3); /* a byte order mark */
    for (char *from = begin;;) {
        stop = memchr(from, '\n', (size_t)(lines->end - from));
        if (!stop) stop = lines->end;
        char *last = stop;
        while (last > begin && last[-1] == '\r') last--;
        if (stop == lines->end || last == begin || last[-1] != '\\') break;
        memset(last - 1, ' ', (size_t)(stop + 1 - (last - 1)));
        lines->joined++;
        from = stop + 1;
    }
    lines->at = stop < lines->end ? stop + 1 : lines->end;
    char *comment = memchr(begin, '#', (size_t)(stop - begin));
    /* Only a # at the start of a word: file names may hold one. */
    while (comment && comment > begin && !is_blank(comment[-1]))
        comment = memchr(comment + 1, '#', (size_t)(stop - comment - 1));
    if (comment) stop = comment;
    while (begin < stop && is_blank(*begin)) begin++;
    while (stop > begin && is_blank(stop[-1])) stop--;
    *line = (text_span){begin, stop};
    return true;
}

bool text_next_word(text_span *line, text_span *word)
{
    const char *p = line->begin;
    while (p < line->end && is_blank(*p)) p++;
    word->begin = p;
    while (p < line->end && !is_blank(*p)) p++;
    word->end = p;
    while (p < line->end && is_blank(*p)) p++;
    line->begin = p;
    return word->begin < word->end;
}

static char lower(char c)
{
    return c >= 'A' && c <= 'Z' ? (char)(c - 'A' + 'a') : c;
}

bool text_is(text_span word, const char *name)
{
    const char *p = word.begin;
    for (; p < word.end && *name; p++, name++)
        if (lower(*p) != lower(*name)) return false;
    return p == word.end && !*name;
}

int text_shown(text_span word)
{
    ptrdiff_t length = word.end - word.begin;
    return length > 80 ? 80 : (int)length;
}

/* Exact powers of ten: a product or quotient of two exact doubles is rounded once. */
static const double powers[] = {1e0,  1e1,  1e2,  1e3,  1e4,  1e5,  1e6,  1e7,  1e8,  1e9,  1e10, 1e11,
                                1e12, 1e13, 1e14, 1e15, 1e16, 1e17, 1e18, 1e19, 1e20, 1e21, 1e22};

static bool slow_number(text_span word, double *value)
{
    char buffer[512];
    size_t length = (size_t)(word.end - word.begin);
    if (length >= sizeof buffer) return false;
    memcpy(buffer, word.begin, length);
    buffer[length] = 0;
    locale_t plain = newlocale(LC_NUMERIC_MASK, "C", (locale_t)0);
    if (plain == (locale_t)0) return false;
    locale_t old = uselocale(plain);
    char *end;
    *value = strtod(buffer, &end);
    uselocale(old);
    freelocale(plain);
    return end == buffer + length && isfinite(*value);
}

bool text_number(text_span word, double *value)
{
    const char *p = word.begin;
    bool negative = p < word.end && *p == '-';
    if (p < word.end && (*p == '-' || *p == '+')) p++;
    uint64_t mantissa = 0;
    int digits = 0, fraction = 0, significant = 0;
    bool dot = false;
    for (; p < word.end; p++) {
        if (*p == '.' && !dot) {
            dot = true;
            continue;
        }
        if (*p < '0' || *p > '9') break;
        digits++;
        if (mantissa || *p != '0') significant++;
        if (significant <= 18) {
            mantissa = mantissa * 10 + (uint64_t)(*p - '0');
            if (dot) fraction++;
        }
    }
    if (!digits) return false;
    int exponent = 0;
    if (p < word.end && (*p == 'e' || *p == 'E')) {
        p++;
        bool minus = p < word.end && *p == '-';
        if (p < word.end && (*p == '-' || *p == '+')) p++;
        if (p == word.end) return false;
        for (; p < word.end && *p >= '0' && *p <= '9'; p++)
            if (exponent < 100000) exponent = exponent * 10 + (*p - '0');
        if (minus) exponent = -exponent;
    }
    if (p != word.end) return false;
    int scale = exponent - fraction;
    if (significant > 18 || mantissa > (UINT64_C(1) << 53) || scale < -22 || scale > 22)
        return slow_number(word, value);
    double magnitude = (double)mantissa;
    magnitude = scale < 0 ? magnitude / powers[-scale] : magnitude * powers[scale];
    *value = negative ? -magnitude : magnitude;
    return true;
}

bool text_integer(text_span word, int64_t *value)
{
    const char *p = word.begin;
    bool negative = p < word.end && *p == '-';
    if (p < word.end && (*p == '-' || *p == '+')) p++;
    if (p == word.end) return false;
    int64_t sum = 0;
    for (; p < word.end; p++) {
        if (*p < '0' || *p > '9') return false;
        sum = sum * 10 + (*p - '0');
        if (sum > INT32_MAX) return false;
    }
    *value = negative ? -sum : sum;
    return true;
}

char *text_path_beside(knurl_context *context, const char *base, const char *name, size_t length)
{
    const char *slash = strrchr(base, '/');
    size_t folder = slash && !(length && name[0] == '/') ? (size_t)(slash - base) + 1 : 0;
    char *path = knurl_alloc(context, folder + length + 1);
    if (!path) return NULL;
    memcpy(path, base, folder);
    for (size_t i = 0; i < length; i++) path[folder + i] = name[i] == '\\' ? '/' : name[i];
    path[folder + length] = 0;
    return path;
}

char *text_copy(knurl_context *context, text_span word)
{
    size_t length = (size_t)(word.end - word.begin);
    char *copy = knurl_alloc(context, length + 1);
    if (!copy) return NULL;
    memcpy(copy, word.begin, length);
    copy[length] = 0;
    return copy;
}
